"""A calibrated lens or mirror: a projection of directions to a plane, then the matrix K."""

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import KW_ONLY
from typing import Annotated, Literal

import numpy as np

from omninav.pipeline import Bounds
from omninav.stages.geometry.arrays import Array, Bools

from .intrinsic_matrix import IntrinsicMatrix
from .model import MAX_SIDE, InnerRadius, OuterRadius, Ring
from .rays import normalised, turned

MAX_COEFFICIENT = 100.0
"""Largest coefficient of a distortion, either way."""
Coefficient = Annotated[float, Bounds(ge=-MAX_COEFFICIENT, le=MAX_COEFFICIENT)]
NOTHING = 1e-12
"""Largest last coefficient of a polynomial that counts as none."""
AZIMUTHS = 16
"""Directions from the principal point in which it is found how far a model goes."""
REAL = 1e-9
"""Largest imaginary part of a root that counts as real."""


def require_all(distortion: Sequence[float], names: str) -> None:
    """Raise ValueError where there are not as many coefficients as `names`, which are separated by commas."""
    expected = len(names.split(","))
    if len(distortion) != expected:
        raise ValueError(f"'D' has {len(distortion)} numbers, expected {expected}: [{names}]")


def smallest_root(polynomial: np.polynomial.Polynomial) -> float:
    """The smallest positive root; infinite where there is none."""
    roots = polynomial.trim(NOTHING).roots()
    return float(roots.real[(np.abs(roots.imag) < REAL) & (roots.real > 0.0)].min(initial=np.inf))


class CalibratedLens(IntrinsicMatrix):
    """A camera whose optical axis is the robot's z; a subclass defines how its lens or mirror projects.

    u runs along the camera's x and v along its y, so a pixel's bearing is atan2(v - cy, u - cx) + yaw.
    """

    _: KW_ONLY
    outer_radius_px: OuterRadius | None = None
    """The image is used out to here; if left out, as far as image and model go all around the axis."""
    inner_radius_px: InnerRadius = 0.0
    looks: Literal["up", "down"] = "up"
    """Direction of the image's centre: up through a lens, or down by way of a mirror above the camera."""

    def __post_init__(self) -> None:
        if self.outer_radius_px is None:
            x, y = self.centre_x, self.centre_y
            room = min(x, self.width - 1 - x, y, self.height_px - 1 - y, MAX_SIDE)
            radii = np.arange(1.0, max(2.0, room + 1.0))
            around = np.linspace(0.0, 2.0 * np.pi, AZIMUTHS, endpoint=False)[:, None]
            rim = np.stack([x + radii * np.cos(around), y + radii * np.sin(around)], axis=-1)
            known = self.unproject(rim)[1].all(axis=0)
            object.__setattr__(self, "outer_radius_px", float(radii[known].max(initial=1.0)))
        super().__post_init__()

    @abstractmethod
    def onto_plane(self, rays: Array) -> Array:
        """Points (..., 2) of the plane that unit rays (..., 3) meet; NaN where they do not. z is the image's centre."""

    @abstractmethod
    def from_plane(self, points: Array) -> Array:
        """The inverse of `onto_plane`: rays (..., 3) of points (..., 2); NaN where there are none."""

    @property
    def ring(self) -> Ring:
        """Pixels between the two radii around the principal point."""
        return Ring(self.centre_x, self.centre_y, self.inner_radius_px, self.outer_radius_px or 1.0)

    def project(self, rays: Array) -> tuple[Array, Bools]:
        """p = K m, of the point m of the plane."""
        pixels = self.pixels_of(self.onto_plane(normalised(turned(rays, -self.yaw)) * self._upward))
        return pixels, self.shows(pixels)

    def unproject(self, pixels: Array) -> tuple[Array, Bools]:
        """The ray of m = K^-1 p."""
        rays = turned(normalised(self.from_plane(self.points_of(pixels))) * self._upward, self.yaw)
        return rays, np.asarray(np.isfinite(rays).all(axis=-1))

    @property
    def _upward(self) -> Array:
        return np.array([1.0, 1.0, 1.0 if self.looks == "up" else -1.0])
