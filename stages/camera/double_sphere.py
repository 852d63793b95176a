"""A wide-angle lens by the double-sphere model."""

from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds
from omninav.stages.geometry.arrays import Array

from .calibrated_lens import CalibratedLens
from .model import Key


class DoubleSphere(CalibratedLens, projection="double_sphere"):
    """A point is projected on one unit sphere, then on a second one `xi` further along the axis, then by a pinhole
    that is shifted by alpha / (1 - alpha).

    Usenko, Demmel & Cremers 2018, "The Double Sphere Camera Model", 3DV (doi 10.1109/3DV.2018.00069, arXiv 1807.08957):
    projection, its inverse in closed form and the sets on which they are valid, as printed there. Calibration tools
    (Kalibr, Basalt) give its six numbers.
    """

    xi: Annotated[float, Key("double_sphere", "xi"), Bounds(gt=-1, le=1)]
    """Distance of the two spheres' centres, in radii."""
    alpha: Annotated[float, Key("double_sphere", "alpha"), Bounds(ge=0, le=1)]
    """Shift of the pinhole: alpha / (1 - alpha)."""

    def onto_plane(self, rays: Array) -> Array:
        """x / (alpha d2 + (1 - alpha)(xi d1 + z)), valid iff z > -w2 d1, d1 = 1."""
        x, y, z = rays[..., 0], rays[..., 1], rays[..., 2]
        shifted = self.xi + z
        second = np.sqrt(x * x + y * y + shifted * shifted)
        w1 = self.alpha / (1.0 - self.alpha) if self.alpha <= 0.5 else (1.0 - self.alpha) / self.alpha
        w2 = (w1 + self.xi) / np.sqrt(2.0 * w1 * self.xi + self.xi * self.xi + 1.0)
        with np.errstate(all="ignore"):
            depth = np.where(z > -w2, self.alpha * second + (1.0 - self.alpha) * shifted, np.nan)
            return np.asarray(rays[..., :2] / depth[..., None])

    def from_plane(self, points: Array) -> Array:
        """Unprojects from the pinhole to the second sphere (m_z), and on to the first; valid iff both roots exist."""
        square = (points**2).sum(axis=-1)
        with np.errstate(divide="ignore", invalid="ignore"):
            root = np.sqrt(1.0 - (2.0 * self.alpha - 1.0) * square)
            mz = (1.0 - self.alpha * self.alpha * square) / (self.alpha * root + 1.0 - self.alpha)
            along = mz * self.xi + np.sqrt(mz * mz + (1.0 - self.xi * self.xi) * square)
            scale = along / (mz * mz + square)
        return np.concatenate([scale[..., None] * points, (scale * mz - self.xi)[..., None]], axis=-1)
