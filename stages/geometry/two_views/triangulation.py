"""Points in space from two bearings each, whatever way the bearings look.

Relative pose as everywhere: X1 = R X2 + t takes coordinates of view 2 to those of view 1, so that `rotation` (3, 3) and
`translation` (3,) are camera 2 seen from camera 1. Units are those of the translation.
"""

import numpy as np
import numpy.typing as npt

from omninav.stages.geometry.arrays import Array


def depths(first: npt.ArrayLike, second: npt.ArrayLike, rotation: Array, translation: Array) -> tuple[Array, Array]:
    """Distances along the bearings of view 1 and view 2 at which the two lines come closest: (N,) and (N,).

    `first`, `second`: (N, 3) unit bearings of the same points. A negative depth is behind, and the pair cannot be one
    point: this, and not a coordinate's sign, tells the right one of the poses that an essential matrix allows
    (erratum 36 in docs/papers.md). Infinite where the lines are parallel.
    """
    first, second = np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64) @ rotation.T
    return closest(first, second, first @ translation, second @ translation)


def closest(first: Array, second: Array, along_first: Array, along_second: Array) -> tuple[Array, Array]:
    """The same, of bearings in one frame, by their components (N,) along the translation, which may differ."""
    cos = np.einsum("ij,ij->i", first, second)
    sine = np.linalg.norm(np.cross(first, second), axis=1) ** 2
    with np.errstate(divide="ignore", invalid="ignore"):
        here = (along_first - cos * along_second) / sine
        there = (cos * along_first - along_second) / sine
    parallel = sine < 1e-24
    return np.where(parallel, np.inf, here), np.where(parallel, np.inf, there)


def triangulate(first: npt.ArrayLike, second: npt.ArrayLike, rotation: Array, translation: Array) -> Array:
    """Points (N, 3) in the frame of view 1: the middle between the two lines where they come closest to each other.

    Rows of NaN where the depth along either bearing is not positive and finite.
    """
    first, second = np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64)
    here, there = depths(first, second, rotation, translation)
    ahead = (here > 0.0) & (there > 0.0) & np.isfinite(here) & np.isfinite(there)
    here, there = np.where(ahead, here, np.nan), np.where(ahead, there, np.nan)
    return np.asarray(0.5 * (here[:, None] * first + there[:, None] * (second @ rotation.T) + translation))


def angles_between(one: Array, other: Array) -> Array:
    """Angles (N,), rad, between vectors (N, 3) and (N, 3)."""
    across = np.linalg.norm(np.cross(one, other), axis=-1)
    return np.asarray(np.arctan2(across, np.einsum("...j,...j->...", one, other)))


def parallax(first: npt.ArrayLike, second: npt.ArrayLike, rotation: Array) -> Array:
    """Angles (N,), rad, between the bearings of the two views: how well the points' depths are known."""
    return angles_between(np.asarray(first, np.float64), np.asarray(second, np.float64) @ rotation.T)
