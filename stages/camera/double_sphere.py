"""A wide-angle lens by the double-sphere model, looking up."""

from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds
from omninav.stages.geometry.arrays import Array, Bools

from .model import Camera, CentreX, CentreY, FocalX, FocalY, InnerRadius, Key, OuterRadius, Ring
from .rays import normalised, turned


class DoubleSphere(Camera, projection="double_sphere"):
    """A point is projected on one unit sphere, then on a second one `xi` further along the axis, then by a pinhole
    that is shifted by alpha / (1 - alpha).

    Usenko, Demmel & Cremers 2018, "The Double Sphere Camera Model", 3DV (doi 10.1109/3DV.2018.00069, arXiv 1807.08957):
    projection, its inverse in closed form and the sets on which they are valid, as printed there. Calibration tools
    (Kalibr, Basalt) give its six numbers. The optical axis is the robot's z; u runs along the camera's x and v along
    its y, so a pixel's bearing is atan2(v - cy, u - cx) + yaw.
    """

    focal_x: FocalX
    """Pixels; with the next three the matrix K."""
    focal_y: FocalY
    centre_x: CentreX
    centre_y: CentreY
    xi: Annotated[float, Key("double_sphere", "xi"), Bounds(gt=-1, le=1)]
    """Distance of the two spheres' centres, in radii."""
    alpha: Annotated[float, Key("double_sphere", "alpha"), Bounds(ge=0, le=1)]
    """Shift of the pinhole: alpha / (1 - alpha)."""
    outer_radius_px: OuterRadius
    """The image is used out to here."""
    inner_radius_px: InnerRadius = 0.0

    @property
    def ring(self) -> Ring:
        """Pixels between the two radii around the principal point."""
        return Ring(self.centre_x, self.centre_y, self.inner_radius_px, self.outer_radius_px)

    def project(self, rays: Array) -> tuple[Array, Bools]:
        """x / (alpha d2 + (1 - alpha)(xi d1 + z)), valid iff z > -w2 d1."""
        rays = turned(rays, -self.yaw)
        x, y, z = rays[..., 0], rays[..., 1], rays[..., 2]
        first = np.sqrt(x * x + y * y + z * z)
        shifted = self.xi * first + z
        second = np.sqrt(x * x + y * y + shifted * shifted)
        w1 = self.alpha / (1.0 - self.alpha) if self.alpha <= 0.5 else (1.0 - self.alpha) / self.alpha
        w2 = (w1 + self.xi) / np.sqrt(2.0 * w1 * self.xi + self.xi * self.xi + 1.0)
        with np.errstate(all="ignore"):
            depth = np.where(z > -w2 * first, self.alpha * second + (1.0 - self.alpha) * shifted, np.nan)
            u, v = self.focal_x * x / depth + self.centre_x, self.focal_y * y / depth + self.centre_y
        pixels = np.stack([u, v], axis=-1)
        return pixels, self.shows(pixels)

    def unproject(self, pixels: Array) -> tuple[Array, Bools]:
        """Unprojects from the pinhole to the second sphere (m_z), and on to the first; valid iff both roots exist."""
        mx, my = (pixels[..., 0] - self.centre_x) / self.focal_x, (pixels[..., 1] - self.centre_y) / self.focal_y
        square = mx * mx + my * my
        with np.errstate(divide="ignore", invalid="ignore"):
            root = np.sqrt(1.0 - (2.0 * self.alpha - 1.0) * square)
            mz = (1.0 - self.alpha * self.alpha * square) / (self.alpha * root + 1.0 - self.alpha)
            along = mz * self.xi + np.sqrt(mz * mz + (1.0 - self.xi * self.xi) * square)
            scale = along / (mz * mz + square)
            rays = normalised(np.stack([scale * mx, scale * my, scale * mz - self.xi], axis=-1))
        return turned(rays, self.yaw), np.asarray(np.isfinite(rays).all(axis=-1))
