"""An omnidirectional camera by a polynomial, as the OCamCalib toolbox calibrates mirrors and fisheye lenses."""

from typing import Annotated, Literal

import numpy as np

from omninav.pipeline import Bounds
from omninav.stages.geometry.arrays import Array, Bools

from .model import FAR_PX, Camera, InnerRadius, Key, OuterRadius, Ring
from .rays import normalised, turned

Affine = Bounds(ge=-10, le=10)

STEPS = 1024
"""Radii between which the polynomial is inverted before Newton's method refines them."""


class OCamCalib(Camera, projection="ocamcalib"):
    """A pixel at radius rho from the centre looks along (x, y, f(rho)), f(rho) = a0 + a1 rho + a2 rho^2 + ….

    Scaramuzza, Martinelli & Siegwart 2006, "A toolbox for easily calibrating omnidirectional cameras", IROS (doi
    10.1109/IROS.2006.282372). The numbers are those of the toolbox's calib_results.txt: its polynomial for the direct
    mapping, its centre (row first) and its affine parameters: (row, column) = [[c, d], [e, 1]] (x, y) + centre. The
    inverse is found from the direct mapping, so the second polynomial there is not needed. A pixel's bearing is
    atan2(y, x) + yaw of its column and row from the centre.
    """

    polynomial: Annotated[tuple[Annotated[float, Bounds(ge=-FAR_PX, le=FAR_PX)], ...], Key("ocamcalib", "polynomial")]
    """a0, a1, …, of which a0 is negative: the centre of the image looks along -z."""
    centre_y: Annotated[float, Key("centre", "y"), Bounds(ge=-FAR_PX, le=FAR_PX)]
    """Row of the centre (pixels)."""
    centre_x: Annotated[float, Key("centre", "x"), Bounds(ge=-FAR_PX, le=FAR_PX)]
    """Column of the centre (pixels)."""
    outer_radius_px: OuterRadius
    """The image is used out to here."""
    inner_radius_px: InnerRadius = 0.0
    c: Annotated[float, Key("ocamcalib", "c"), Affine] = 1.0
    """Stretch of rows against columns."""
    d: Annotated[float, Key("ocamcalib", "d"), Affine] = 0.0
    """Shear of rows by columns."""
    e: Annotated[float, Key("ocamcalib", "e"), Affine] = 0.0
    """Shear of columns by rows."""
    looks: Annotated[Literal["up", "down"], Key("ocamcalib", "looks")] = "up"
    """Direction of the image's centre: up through a lens, or down by way of a mirror above the camera."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.polynomial) < 2 or self.polynomial[0] >= 0.0:
            raise ValueError("'ocamcalib.polynomial' must be [a0, a1, …] with a0 below 0")
        if self.c - self.d * self.e <= 0.0:
            raise ValueError("'ocamcalib.c' must be above d * e")

    @property
    def ring(self) -> Ring:
        """Pixels between the two radii around the centre."""
        return Ring(self.centre_x, self.centre_y, self.inner_radius_px, self.outer_radius_px)

    def project(self, rays: Array) -> tuple[Array, Bools]:
        """The radius at which f(rho) / rho is the ray's slope: between tabled ones, then by Newton's method."""
        rays = turned(rays, -self.yaw)
        level, z = np.hypot(rays[..., 0], rays[..., 1]), self._sign() * rays[..., 2]
        radii = np.linspace(0.0, 1.1 * (self.outer_radius_px + 1.0), STEPS)
        slopes = np.arctan2(self._height(radii), radii)
        rising = int(np.argmax(np.append(np.diff(slopes) <= 0.0, True))) + 1  # beyond it, rays would have two pixels
        slope = np.arctan2(z, level)
        rho = np.interp(slope, slopes[:rising], radii[:rising], right=np.nan)
        derivative = np.polynomial.Polynomial(self.polynomial).deriv()
        with np.errstate(divide="ignore", invalid="ignore"):
            for _ in range(4):
                rho = rho - (self._height(rho) * level - z * rho) / (derivative(rho) * level - z)
            scale = np.where(level > 0.0, rho / level, 0.0)
        column, row = scale * rays[..., 0], scale * rays[..., 1]
        u = self.centre_x + self.e * row + column
        pixels = np.stack([u, self.centre_y + self.c * row + self.d * column], axis=-1)
        return pixels, self.shows(pixels)

    def unproject(self, pixels: Array) -> tuple[Array, Bools]:
        """The affine parameters undone, then (x, y, f(rho))."""
        u, v = pixels[..., 0] - self.centre_x, pixels[..., 1] - self.centre_y
        row = (v - self.d * u) / (self.c - self.d * self.e)
        column = u - self.e * row
        z = self._sign() * self._height(np.hypot(row, column))
        return turned(normalised(np.stack([column, row, z], axis=-1)), self.yaw), np.ones(u.shape, np.bool_)

    def _sign(self) -> float:
        return 1.0 if self.looks == "down" else -1.0

    def _height(self, rho: Array) -> Array:
        return np.polynomial.Polynomial(self.polynomial)(rho)
