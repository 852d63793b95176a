"""Drives through a simulated world as recordings: pictures are rendered when asked for."""

import dataclasses
import json
from collections import Counter
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt

from omninav.pipeline.files import digest_file, digest_text
from omninav.stages import simulator
from omninav.stages.geometry import catadioptric, se2
from omninav.stages.simulator.cameras import Rays, camera_rays
from omninav.stages.simulator.config import MirrorCamera, WorldConfig
from omninav.stages.simulator.odometry import draw_bias, odometry
from omninav.stages.simulator.renderer import render
from omninav.stages.simulator.robot import drive, wandered
from omninav.stages.simulator.world import World, stream
from omninav.stages.values.camera import HyperbolicMirror
from omninav.stages.values.image import Pixels

from .recording import UnreadableRecording

F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]

EPOCH = 1_767_571_200 * 10**9
"""Midnight before day 0, 2026-01-05 UTC, in nanoseconds."""
OFFSET = 0.52
"""Seconds from the start of a drive to its first picture: odometry reaches back before it."""


class SimulatedRecording:
    """One drive along a named route of a world, on a day: the same seed, route and day give the same bytes.

    A `Recording`. Pictures come in any order at the same price and with the same noise. The day decides the line that
    is driven, the odometry's errors, the noise and which goods were moved. Raises `UnreadableRecording` for a route that
    the world does not have.
    """

    def __init__(self, world: WorldConfig, route: str, day: int) -> None:
        if route not in world.routes:
            raise UnreadableRecording(
                f"world '{world.name}' has no route '{route}'; it has: {', '.join(sorted(world.routes)) or 'none'}"
            )
        self.world = world
        self.route = route
        self.day = day
        self.camera = mirror(world.camera)
        self.dropped: Counter[str] = Counter()
        self.details: dict[str, str] = {}
        start = EPOCH + day * 86400 * 10**9 + (9 + sorted(world.routes).index(route)) * 3600 * 10**9
        line = wandered(world.routes[route].waypoints, world.robot.wander, self._stream("line"))
        times, self.driven = drive(line, world.robot, world.timing.odometry)
        self.times: I64 = start + np.round(times * 1e9).astype(np.int64)
        noise = self._stream("odometry")
        bias = draw_bias(world.odometry, stream(world.seed, "odometry bias", day))
        self.rolled = odometry(self.driven, world.odometry, bias, noise)
        count = max(0, int(np.floor((times[-1] - OFFSET) * world.timing.pictures + 1e-9)) + 1)
        self._seconds = OFFSET + np.arange(count) / world.timing.pictures
        self.stamps: I64 = start + np.round(self._seconds * 1e9).astype(np.int64)
        self.truth = se2.interpolate(times, self.driven, self._seconds)
        self.odometry = se2.interpolate(times, self.rolled, self._seconds)

    @property
    def name(self) -> str:
        """World, route and day in words."""
        return f"{self.world.name}, route {self.route}, day {self.day}"

    @cached_property
    def _world(self) -> World:
        return World(self.world, self.day)

    @cached_property
    def _key(self) -> int:
        return int(self._stream("pixels").integers(2**62))

    def _stream(self, purpose: str) -> np.random.Generator:
        return stream(self.world.seed, purpose, self.route, self.day)

    def image(self, frame: int) -> Pixels:
        """The picture of a frame, (height, width, 3) uint8 blue-green-red, rendered now."""
        sensor = self.world.sensor
        swing = np.sin(2 * np.pi * self._seconds[frame] / sensor.exposure_period)
        return render(
            self._world.scene,
            self._rays,
            self.truth[frame],
            self.world.camera.height,
            exposure=sensor.exposure * (1.0 + sensor.exposure_drift * float(swing)),
            noise=sensor.noise,
            key=self._key + frame,
        )

    @cached_property
    def _rays(self) -> Rays:
        return camera_rays(self.camera, self.world.sensor.vignetting)

    def digest(self) -> str:
        """sha256 over the world, the route, the day and the code that renders it."""
        folder = Path(simulator.__file__).parent
        code = [*sorted(folder.glob("*.py")), Path(__file__), Path(catadioptric.__file__), Path(se2.__file__)]
        described = json.dumps(dataclasses.asdict(self.world), sort_keys=True)
        return digest_text(described, self.route, str(self.day), *(digest_file(path) for path in code))


def mirror(camera: MirrorCamera) -> HyperbolicMirror:
    """A world's camera as the value that travels on wires."""
    return HyperbolicMirror(
        width=camera.width,
        height_px=camera.height_px,
        focal_x=camera.focal,
        focal_y=camera.focal,
        centre_x=camera.centre[0],
        centre_y=camera.centre[1],
        a=camera.a,
        b=camera.b,
        inner_radius_px=camera.inner_radius_px,
        outer_radius_px=camera.outer_radius_px,
        height=camera.height,
        yaw=camera.yaw,
    )
