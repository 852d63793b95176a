"""A mirror or a lens by the unified projection model, as OpenCV, Kalibr and Mei's toolbox calibrate it."""

from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds
from omninav.stages.geometry.arrays import Array, Bools

from .calibrated_lens import CalibratedLens, Coefficient, require_all, smallest_root
from .model import Key

ROUNDS = 12
"""Largest number of rounds of Newton's method in which distortion is undone."""
UNDONE = 1e-12
"""Largest step of Newton's method after which nothing is left to undo, focal lengths."""
SAME = 1e-9
"""Largest distance of an undone point, distorted again, from the one that was seen, focal lengths."""


class Unified(CalibratedLens, projection="unified"):
    """A point is projected on the unit sphere, then from `xi` behind its centre on a plane, and there distorted.

    Mei & Rives 2007, "Single view point omnidirectional camera calibration from planar grids", ICRA (doi
    10.1109/ROBOT.2007.364084): equations 1 to 4. `omnidir` of OpenCV, `omni-radtan` of Kalibr and the data set
    KITTI-360 give its numbers.
    """

    xi: Annotated[float, Bounds(ge=0, le=100)]
    """Distance of the pinhole from the sphere's centre, in radii."""
    distortion: Annotated[tuple[Coefficient, ...], Key("", "D")]
    """k1, k2, p1, p2: radial, then tangential."""

    def __post_init__(self) -> None:
        require_all(self.distortion, "k1, k2, p1, p2")
        super().__post_init__()

    def onto_plane(self, rays: Array) -> Array:
        """(x, y) / (z + xi), distorted; valid in front of the pinhole, as far as points move outward with the angle."""
        z = rays[..., 2]
        behind = z <= (-self.xi if self.xi <= 1.0 else -1.0 / self.xi)
        with np.errstate(divide="ignore", invalid="ignore"):
            points = rays[..., :2] / np.where(behind, np.nan, z + self.xi)[..., None]
            return np.where(self._grows(points)[..., None], self._distorted(points)[0], np.nan)

    def from_plane(self, points: Array) -> Array:
        """The distortion undone, then the point lifted to the sphere."""
        plain = points
        with np.errstate(all="ignore"):
            for _ in range(ROUNDS):
                seen, (xx, xy, yy) = self._distorted(plain)
                (x, y), determinant = np.moveaxis(points - seen, -1, 0), xx * yy - xy * xy
                step = np.stack([yy * x - xy * y, xx * y - xy * x], axis=-1) / determinant[..., None]
                plain = plain + step
                if not (np.abs(step) > UNDONE).any():
                    break
            undone = np.abs(self._distorted(plain)[0] - points).max(axis=-1) < SAME
            square = (plain**2).sum(axis=-1)
            scale = (self.xi + np.sqrt(1.0 + (1.0 - self.xi**2) * square)) / (1.0 + square)
            scale = np.where(undone & self._grows(plain), scale, np.nan)
        return np.concatenate([scale[..., None] * plain, (scale - self.xi)[..., None]], axis=-1)

    def _grows(self, points: Array) -> Bools:
        """Which points (..., 2) are where distortion neither folds the plane nor reverses the order of radii."""
        k1, k2 = self.distortion[:2]
        turning = smallest_root(np.polynomial.Polynomial([1.0, 3.0 * k1, 5.0 * k2]))
        _, (xx, xy, yy) = self._distorted(points)
        return np.asarray(((points**2).sum(axis=-1) < turning) & (xx * yy - xy * xy > 0.0))

    def _distorted(self, points: Array) -> tuple[Array, tuple[Array, Array, Array]]:
        """Points (..., 2) after distortion, and its derivatives by x and y: xx, xy (the same as yx) and yy."""
        k1, k2, p1, p2 = self.distortion
        x, y = points[..., 0], points[..., 1]
        square = x * x + y * y
        radial, slope = 1.0 + k1 * square + k2 * square * square, 2.0 * k1 + 4.0 * k2 * square
        seen = np.stack(
            [
                x * radial + 2.0 * p1 * x * y + p2 * (square + 2.0 * x * x),
                y * radial + p1 * (square + 2.0 * y * y) + 2.0 * p2 * x * y,
            ],
            axis=-1,
        )
        xx = radial + slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x
        yy = radial + slope * y * y + 6.0 * p1 * y + 2.0 * p2 * x
        return seen, (xx, slope * x * y + 2.0 * p1 * x + 2.0 * p2 * y, yy)
