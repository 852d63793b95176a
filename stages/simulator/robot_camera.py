"""The robot's camera: images as it takes them, with the errors that its camera.yaml does not know of."""

import dataclasses
import math
from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from omninav.stages.camera.model import Camera
from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.plane.mount import camera_poses
from omninav.stages.recordings.recording import UnreadableRecording
from omninav.stages.values.image import Pixels

from .cameras import Rays, camera_of, camera_rays, leaning
from .config import WorldConfig
from .people import Person
from .renderer import Scene, render
from .streams import stream

FOCAL_LENGTHS = ("focal_x", "focal_y", "focal_px")
CENTRE = ("centre_x", "centre_y")
"""Parameters of cameras that have the focal length and the centre."""


class RobotCamera:
    """The camera of a world's robot on one drive.

    `described` is the camera of camera.yaml. `drive`: names of the drive, from which its exposure's jumps follow.
    Raises `UnreadableRecording` for a description without height, and for an error of a focal length that it lacks.
    """

    def __init__(self, world: WorldConfig, *drive: str | int) -> None:
        self.described = camera_of(world)
        self._world, self._drive = world, drive
        self._mounting = lean(math.radians(world.camera_errors.tilt_deg), self._drawn("tilt").uniform(0, 2 * math.pi))
        self._ramps_begin = self._drawn("ramps").uniform(0, world.ramps.period_m)
        self._true = self._with_errors()

    def image(self, scene: Scene, poses: Array, seconds: float, key: int, people: Sequence[Person] = ()) -> Pixels:
        """The image (rows, columns, 3) that is taken of a scene `seconds` into the drive.

        `poses` (N, 3): where the robot is at the `shutter_times`. `key`: of the sensor's noise.
        """
        return render(
            scene,
            self._rays_at(poses[len(poses) // 2]),
            camera_poses(poses, self.described.arm),
            self._world.eye_height,
            exposure=self._exposure(seconds),
            noise=self._world.sensor.noise,
            key=key,
            people=people,
        )

    def _exposure(self, seconds: float) -> float:
        sensor = self._world.sensor
        swing = float(np.sin(2 * np.pi * seconds / sensor.exposure_period))
        steady = sensor.exposure * (1.0 + sensor.exposure_drift * swing)
        if sensor.exposure_jumps == 0.0:
            return steady
        stops = self._drawn("exposure", *self._drive, int(seconds // sensor.exposure_hold_s)).normal()
        return steady * float(2.0 ** (sensor.exposure_jumps * stops))

    def _rays_at(self, pose: Array) -> Rays:
        """The rays of the camera in the frame of a robot that is level."""
        if self._world.ramps.slope_deg == 0.0:
            return self._rays
        return leaning(self._rays, self._slope(float(pose[0]), float(pose[2])))

    def _slope(self, x: float, heading: float) -> Array:
        """Rotation (3, 3) of a robot on the ramps: it leans backwards along x where the floor rises."""
        ramps = self._world.ramps
        wave = 2.0 * math.sin(2 * math.pi * (x - self._ramps_begin) / ramps.period_m)
        return lean(math.radians(ramps.slope_deg) * max(-1.0, min(1.0, wave)), math.pi - heading)

    @cached_property
    def _rays(self) -> Rays:
        rays = camera_rays(self._true, self._world.sensor.vignetting, self._world.robot.radius)
        return leaning(rays, self._mounting) if self._world.camera_errors.tilt_deg else rays

    def _with_errors(self) -> Camera:
        """The camera as it is: its focal lengths and its centre are not quite those of camera.yaml."""
        errors, rng = self._world.camera_errors, self._drawn("calibration")
        scale, towards = 1.0 + errors.focal * float(rng.choice((-1.0, 1.0))), rng.uniform(0, 2 * math.pi)
        changed: dict[str, Any] = {}
        if errors.focal:
            changed |= {name: scale * value for name, value in self._described("focal", FOCAL_LENGTHS).items()}
        if errors.centre_px:
            centre = self._described("centre_px", CENTRE)
            shifts = (errors.centre_px * math.cos(towards), errors.centre_px * math.sin(towards))
            changed |= {name: value + shift for (name, value), shift in zip(centre.items(), shifts, strict=True)}
        return dataclasses.replace(self.described, **changed)

    def _described(self, error: str, names: Sequence[str]) -> dict[str, float]:
        """Those of the camera's numbers that it has. Raises `UnreadableRecording` where it has none of them."""
        found = {name: getattr(self.described, name, None) for name in names}
        known = {name: float(value) for name, value in found.items() if value is not None}
        if not known:
            raise UnreadableRecording(
                f"world.camera_errors.{error}: a {self.described.projection} camera has no {' or '.join(names)}; "
                f"type world.camera_errors.{error}=0"
            )
        return known

    def _drawn(self, *purpose: str | int) -> np.random.Generator:
        return stream(self._world.draw_seed, "camera", *purpose)


def lean(angle: float, towards: float) -> Array:
    """The rotation (3, 3) that tips the vertical by `angle` (rad) to the azimuth `towards` (Rodrigues' formula)."""
    x, y = -math.sin(towards), math.cos(towards)
    cross = np.array([[0.0, 0.0, y], [0.0, 0.0, -x], [-y, x, 0.0]])
    rotation: Array = np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * cross @ cross
    return rotation
