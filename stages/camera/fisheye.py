"""An equidistant fisheye lens that looks up."""

import math
from typing import Annotated, Self

import numpy as np

from omninav.pipeline import Bounds
from omninav.stages.geometry.arrays import Array, Bools

from .model import FAR_PX, Camera, InnerRadius, Key, OuterRadius, Ring, Sense
from .rays import angles, unit_vectors


class Fisheye(Camera, projection="fisheye"):
    """A lens whose radius in the image grows with the angle from the optical axis, by `focal_px` per radian.

    A pixel's bearing is atan2(v - cy, u - cx) + yaw where `sense` is clockwise, as with a mirror.
    """

    focal_px: Annotated[float, Key("", "focal_px"), Key("K", 0), Bounds(ge=1, le=FAR_PX)]
    """Pixels per radian."""
    centre_x: Annotated[float, Key("centre", "x"), Key("K", 2), Bounds(ge=-FAR_PX, le=FAR_PX)]
    centre_y: Annotated[float, Key("centre", "y"), Key("K", 5), Bounds(ge=-FAR_PX, le=FAR_PX)]
    outer_radius_px: OuterRadius
    """The image is used out to here."""
    inner_radius_px: InnerRadius = 0.0
    sense: Sense = "clockwise"

    @property
    def ring(self) -> Ring:
        """Pixels between the two radii."""
        return Ring(self.centre_x, self.centre_y, self.inner_radius_px, self.outer_radius_px)

    @classmethod
    def of_size(cls, width: int, height: int) -> Self:
        """A circle of 180 degrees that fills the image."""
        radius = min(width, height) / 2
        return cls(width, height, 2 * radius / math.pi, (width - 1) / 2, (height - 1) / 2, radius)

    def project(self, rays: Array) -> tuple[Array, Bools]:
        """Radius = focal_px x angle from the zenith."""
        azimuth, elevation = angles(rays)
        radius = self.focal_px * (math.pi / 2 - elevation)
        sign = 1.0 if self.sense == "clockwise" else -1.0
        u = self.centre_x + radius * np.cos(azimuth - self.yaw)
        pixels = np.stack([u, self.centre_y + sign * radius * np.sin(azimuth - self.yaw)], axis=-1)
        return pixels, self.shows(pixels)

    def unproject(self, pixels: Array) -> tuple[Array, Bools]:
        """Angle from the zenith = radius / focal_px; out to the nadir."""
        x, y = pixels[..., 0] - self.centre_x, pixels[..., 1] - self.centre_y
        sign = 1.0 if self.sense == "clockwise" else -1.0
        from_zenith = np.hypot(x, y) / self.focal_px
        looks: Bools = from_zenith <= math.pi
        elevation = np.where(looks, math.pi / 2 - from_zenith, np.nan)
        return unit_vectors(np.arctan2(sign * y, x) + self.yaw, elevation), looks
