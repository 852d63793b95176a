"""The axis of a drive's camera beside where `camera.yaml` has it, by the landmarks of the map."""

import math
from dataclasses import field
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Shape, Value
from omninav.stages.camera.model import Camera
from omninav.stages.camera.self_calibration import AXIS, SAME_RAY, adjustable, observed
from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.landmarks.adjustment import rotations_about
from omninav.stages.geometry.landmarks.bearing_pose import HEIGHT_SIGMA_M, TILT_SIGMA

STEP_PX = 0.5
"""Step of the derivatives of bearings, pixels."""
MIN_LANDMARKS = 20
"""Fewest landmarks of an image that counts: its pose takes six numbers of them."""
KEPT = 0.98
"""Factor of what images have shown, at each further one: the first, without a correction, showed the axis too near."""
MIN_SIGMAS, MIN_PX = 8.0, 0.5
"""Smallest distance of the axis from its description that counts, in standard deviations, and in pixels."""


class AxisBeside(Value):
    """Normal equations (2, 2) and (2,) of how far right and below of its description the axis is, in pixels.

    `images`: how many they are of, as far as these are kept.
    """

    square: Annotated[Array, Shape(2, 2)] = field(default_factory=lambda: np.zeros((2, 2)))
    slope: Annotated[Array, Shape(2)] = field(default_factory=lambda: np.zeros(2))
    images: Annotated[float, Bounds(ge=0)] = 0.0

    def distance(self) -> Array:
        """The distance (2,) in pixels, columns and rows; 0 where it is small or not sure."""
        if not self.square.any():
            return np.zeros(2)
        found: Array = np.linalg.solve(self.square, self.slope).astype(np.float64)
        sure = found @ self.square @ found > MIN_SIGMAS**2 and math.hypot(*found) > MIN_PX
        return found if sure else np.zeros(2)

    def bearings(self, camera: Camera | None, pixels: Array, described: Array) -> Array:
        """The bearings (N, 3) of pixels (N, 2), of the `described` ones where the axis is where it should be."""
        distance = self.distance()
        return adjustable(camera, pixels, AXIS).bearings(distance) if camera and distance.any() else described

    def seen(
        self, camera: Camera, pixels: Array, described: Array, points: Array, pose: Array, variance: float
    ) -> "AxisBeside":
        """Adds an image that shows landmarks (M, 3) at pixels (M, 2) with these bearings (M, 3).

        `pose` (3,): of the camera, about; it is estimated too, on a floor, and eliminated. `variance`: of a bearing
        (rad^2). Nothing is added by few landmarks, nor by bearings that are not those of the camera's pixels.
        """
        if len(pixels) < MIN_LANDMARKS or not observed(camera, poses_given=False):
            return self
        lens, (turn,) = adjustable(camera, pixels, AXIS), rotations_about(pose[2:], 2)
        as_described = lens.bearings(np.zeros(2))
        if np.abs(as_described - described).max() > SAME_RAY:
            return self
        steps = STEP_PX * np.eye(2)
        moved = np.stack([lens.bearings(step) - lens.bearings(-step) for step in steps], axis=2) / (2.0 * STEP_PX)
        rays = points - [pose[0], pose[1], 0.0]
        lengths = np.linalg.norm(rays, axis=1)
        rays /= lengths[:, None]
        seen, now = as_described @ turn.T, lens.bearings(self.distance()) @ turn.T
        weights = 1.0 / (1.0 + ((rays - now) ** 2).sum(axis=1) / (4.0 * variance)) / variance
        shifted = (rays[:, :, None] * rays[:, None] - np.eye(3)) / lengths[:, None, None]
        rows = np.concatenate([shifted, np.cross(seen[:, None], np.eye(3)).transpose(0, 2, 1), -(turn @ moved)], axis=2)
        square = np.einsum("m,mik,mil->kl", weights, rows, rows)
        slope = -np.einsum("m,mik,mi->k", weights, rows, rays - seen)
        square[range(2, 5), range(2, 5)] += np.array([HEIGHT_SIGMA_M, TILT_SIGMA, TILT_SIGMA]) ** -2.0
        share = square[6:, :6] @ np.linalg.pinv(square[:6, :6], hermitian=True)
        return AxisBeside(
            KEPT * self.square + square[6:, 6:] - share @ square[:6, 6:],
            KEPT * self.slope + slope[6:] - share @ slope[:6],
            KEPT * self.images + 1.0,
        )
