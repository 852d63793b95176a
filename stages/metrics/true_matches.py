"""Which matches of two views are right, where it is known how the robot moved: by depths, or by geometry alone."""

import numpy as np
import numpy.typing as npt

from omninav.stages.geometry.arrays import Array, Bools
from omninav.stages.geometry.two_views.epipolar import shared_residuals, turn_about_vertical
from omninav.stages.geometry.two_views.triangulation import angles_between, depths, parallax

Motion = tuple[float, float, float]
"""Pose of the second view seen from the first: x forward, y left (m), turn (rad)."""


def right_by_depth(
    first: npt.ArrayLike,
    second: npt.ArrayLike,
    near: npt.ArrayLike,
    far: npt.ArrayLike,
    moved: Motion,
    limit: float | Array,
) -> Bools:
    """Matches (N,) whose point, placed by its depth in one of the views, is seen where the other view has it.

    `first`, `second` (N, 3): unit bearings. `near`, `far` (N,): metres to what each shows in its own view. `limit`
    (rad), one or one for each: the angle it may be off. One depth is enough: on an edge a ray may just pass by.
    """
    first, second = np.asarray(first, np.float64), np.asarray(second, np.float64)
    rotation, way = turn_about_vertical(moved[2]), np.array([moved[0], moved[1], 0.0])
    there = (np.asarray(near)[:, None] * first - way) @ rotation
    here = np.asarray(far)[:, None] * second @ rotation.T + way
    off = np.minimum(angles_between(there, second), angles_between(here, first))
    return np.asarray(off <= limit)


def right_by_epipolar(first: npt.ArrayLike, second: npt.ArrayLike, moved: Motion, limit: float) -> Bools:
    """Matches (N,) whose bearings are within `limit` (rad) of one plane with the way, and meet in front of both views.

    Where there is no depth, this is all that truth tells: a wrong match along the plane passes, and all on the horizon
    do. Bearings within `limit` of parallel meet far away.
    """
    first, second = np.asarray(first, np.float64), np.asarray(second, np.float64)
    rotation, way = turn_about_vertical(moved[2]), np.array([moved[0], moved[1], 0.0])
    if not way.any():
        return np.asarray(parallax(first, second, rotation) <= limit)
    here, there = depths(first, second, rotation, way)
    ahead = (here > 0.0) & (there > 0.0) & np.isfinite(here) | (parallax(first, second, rotation) <= limit)
    return np.asarray(ahead & (shared_residuals(rotation, way / np.linalg.norm(way), first, second) <= limit))
