"""The vertical of a camera that leans on its robot, from two of its images.

A robot on a floor turns about the vertical, however its camera is mounted: it is the axis of the relative rotation.
"""

import math
from dataclasses import replace

import numpy as np

from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.two_views.ransac import AgreedPose
from omninav.stages.geometry.two_views.relative_pose_ransac import relative_pose

MIN_TURN_DEG = 15.0
"""Smallest turn between two images that tells its axis, degrees."""
MAX_TILT_DEG = 10.0
"""Largest tilt of a camera, degrees: axes of wrong poses look anywhere."""
MAX_SAMPLES = 400
"""Samples of five pairs at most: half of the pairs right are enough to find them."""


def vertical_of(
    first: Array, second: Array, rng: np.random.Generator, threshold: float, min_inliers: int
) -> Array | None:
    """The vertical (3,) in the camera's frame by pairs of unit bearings (N, 3) of two views, some paired wrongly.

    `threshold` (rad): see `relative_pose`. None where fewer than `min_inliers` agree on a pose, or it is none of a
    robot that turned on a floor. Draws from `rng`.
    """
    if len(first) < min_inliers:
        return None
    found = relative_pose(first, second, rng, "five_point", threshold, max_samples=MAX_SAMPLES)
    if found is None or np.count_nonzero(found.inliers) < min_inliers:
        return None
    R = found.rotation
    axis = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])  # twice the sine of the turn long
    length = float(np.linalg.norm(axis))
    turn = math.atan2(length, float(np.trace(R)) - 1.0)
    upward = math.copysign(1.0, axis[2]) * axis
    if turn < math.radians(MIN_TURN_DEG) or upward[2] < math.cos(math.radians(MAX_TILT_DEG)) * length:
        return None
    return np.asarray(upward / length)


def levelling(vertical: Array) -> Array:
    """The rotation (3, 3) that brings a vertical (3,) of unit length up, without turning about it."""
    x, y, z = vertical
    share = 1.0 / (1.0 + z)
    return np.array([[1.0 - share * x * x, -share * x * y, -x], [-share * x * y, 1.0 - share * y * y, -y], [x, y, z]])


def seen_leaning(pose: AgreedPose, level: Array) -> AgreedPose:
    """A pose between level frames as one between the camera's own, `level` (3, 3) bringing these to the former."""
    return replace(pose, rotation=level.T @ pose.rotation @ level, translation=level.T @ pose.translation)
