"""Uncalibrated catadioptric camera: the mirror image is a ring, with one azimuth along each radius."""

import dataclasses
from typing import Annotated, Any, Self

import numpy as np

from omninav.pipeline import BadInput, Bounds
from omninav.stages.geometry.arrays import Array, Bools
from omninav.stages.values.image import Pixels

from .mirror_ring import RingNotFound, find_ring
from .model import FAR_PX, Camera, Key, Ring, Sense
from .rays import angles, unit_vectors


class Donut(Camera, projection="donut"):
    """A ring between two circles. Azimuths are right; elevations are a guess: of square pixels, the horizon in the
    middle of the ring.

    Centre and radii are None where they are to be found in an image (`found_in`); rays and pixels are refused then
    (BadInput).
    """

    centre_x: Annotated[float | None, Key("centre", "x"), Bounds(ge=-FAR_PX, le=FAR_PX)] = None
    """Pixels, as the next three."""
    centre_y: Annotated[float | None, Key("centre", "y"), Bounds(ge=-FAR_PX, le=FAR_PX)] = None
    inner_radius_px: Annotated[float | None, Key("mask", "inner_radius_px"), Bounds(ge=0, le=FAR_PX)] = None
    outer_radius_px: Annotated[float | None, Key("mask", "outer_radius_px"), Bounds(gt=0, le=FAR_PX)] = None
    sense: Sense = "clockwise"

    @classmethod
    def of_size(cls, width: int, height: int) -> Self:
        """A ring that is still to be found."""
        return cls(width, height)

    @property
    def ring(self) -> Ring | None:
        """Pixels between the two radii; None where one of the four numbers is not known."""
        x, y, inner, outer = self.centre_x, self.centre_y, self.inner_radius_px, self.outer_radius_px
        if x is None or y is None or inner is None or outer is None:
            return None
        return Ring(x, y, inner, outer)

    @property
    def complete(self) -> bool:
        """Tells whether its ring is known."""
        return self.ring is not None

    def found_in(self, pixels: Pixels) -> Self | None:
        """The donut with the numbers that it leaves open as an image shows them; None where no ring is found."""
        if self.complete:
            return self
        try:
            ring = find_ring(pixels)
        except RingNotFound:
            return None
        names = ("centre_x", "centre_y", "inner_radius_px", "outer_radius_px")
        left_open: dict[str, Any] = {
            name: value for name, value in zip(names, ring, strict=True) if getattr(self, name) is None
        }
        return dataclasses.replace(self, **left_open)

    @property
    def elevations_known(self) -> bool:
        """They are a guess."""
        return False

    def project(self, rays: Array) -> tuple[Array, Bools]:
        """Radius = (1 + elevation) x the middle one. Raises BadInput."""
        ring = self._known()
        azimuth, elevation = angles(rays)
        sign = 1.0 if self.sense == "clockwise" else -1.0
        radius = (1.0 + elevation) * (ring.inner + ring.outer) / 2.0
        u = ring.centre_x + radius * np.cos(azimuth - self.yaw)
        pixels = np.stack([u, ring.centre_y + sign * radius * np.sin(azimuth - self.yaw)], axis=-1)
        return pixels, self.shows(pixels) & (radius >= 0.0)  # lower, a ray would land across the ring

    def unproject(self, pixels: Array) -> tuple[Array, Bools]:
        """Elevation = radius / the middle one - 1. Raises BadInput."""
        ring = self._known()
        x, y = pixels[..., 0] - ring.centre_x, pixels[..., 1] - ring.centre_y
        sign = 1.0 if self.sense == "clockwise" else -1.0
        middle = (ring.inner + ring.outer) / 2.0
        elevation = (np.hypot(x, y) - middle) / middle
        return unit_vectors(np.arctan2(sign * y, x) + self.yaw, elevation), np.ones(elevation.shape, np.bool_)

    def _known(self) -> Ring:
        if self.ring is None:
            raise BadInput(
                "camera: a donut without centre_x, centre_y, inner_radius_px and outer_radius_px; give centre and mask "
                "in camera.yaml"
            )
        return self.ring
