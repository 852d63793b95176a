"""Drives through a simulated world as recordings: pictures are rendered when asked for."""

import dataclasses
import json
from collections import Counter
from functools import cached_property
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from omninav.pipeline.files import digest_file, digest_text
from omninav.pipeline.log import LogWriter
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

from .camera_yaml import write_camera
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
    is driven, the odometry's errors, the noise and which goods were moved. Raises `UnreadableRecording` for a route
    that the world does not have.
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


def record(recording: SimulatedRecording, path: Path, quality: int = 90) -> None:
    """Write a simulated drive as an MCAP log: JPEG pictures, camera information, odometry, truth, and camera.yaml.

    Topics as every recording has them; odometry and truth at their own rate. Log times run behind header stamps as a
    camera's and a wheel's do (42 and 2 ms). The same recording gives the same bytes.
    """
    camera = recording.camera
    matrix = [camera.focal_x, camera.skew, camera.centre_x, 0.0, camera.focal_y, camera.centre_y, 0.0, 0.0, 1.0]
    info = {
        "header": {"frame_id": "omni_camera"},
        "width": camera.width,
        "height": camera.height_px,
        "distortion_model": "hyperbolic_mirror",
        "d": [camera.a, camera.b],
        "k": matrix,
    }
    events = [(int(stamp) + 2_000_000, 0, number) for number, stamp in enumerate(recording.times)]
    events += [(int(stamp) + 42_000_000, 1, number) for number, stamp in enumerate(recording.stamps)]
    with LogWriter(path) as log:
        log.attach("camera.yaml", write_camera(camera).encode(), "application/yaml")
        for time, kind, number in sorted(events):
            if kind == 0:
                stamp = int(recording.times[number])
                rolled = {
                    "header": {"frame_id": "odom"},
                    "child_frame_id": "base_link",
                    "pose": {"pose": _pose(recording.rolled[number])},
                }
                truth = {"header": {"frame_id": "map"}, "pose": _pose(recording.driven[number])}
                log.write("/odom", "nav_msgs/msg/Odometry", stamp, rolled, time)
                log.write("/ground_truth/pose", "geometry_msgs/msg/PoseStamped", stamp, truth, time)
            else:
                stamp = int(recording.stamps[number])
                _, packed = cv2.imencode(".jpg", recording.image(number), [cv2.IMWRITE_JPEG_QUALITY, quality])
                picture = {"header": {"frame_id": "omni_camera"}, "format": "jpeg", "data": packed.ravel()}
                log.write("/camera/camera_info", "sensor_msgs/msg/CameraInfo", stamp, info, time)
                log.write("/camera/image/compressed", "sensor_msgs/msg/CompressedImage", stamp, picture, time)


def _pose(pose: F64) -> dict[str, Any]:
    """A pose (x, y, heading) as the fields of a geometry_msgs/Pose."""
    x, y, heading = (float(value) for value in pose)
    turned = {"z": float(np.sin(heading / 2)), "w": float(np.cos(heading / 2))}
    return {"position": {"x": x, "y": y}, "orientation": turned}


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
