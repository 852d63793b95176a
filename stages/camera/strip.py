"""Images that show the full circle side by side: one azimuth per column."""

import math
from abc import abstractmethod
from dataclasses import KW_ONLY
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds
from omninav.stages.geometry.arrays import Array, Bools

from .model import FAR_PX, Camera, Key, Sense
from .rays import angles, unit_vectors

Elevation = Bounds(ge=-math.pi / 2 - 1e-6, le=math.pi / 2 + 1e-6)
Top = Annotated[float, Key("elevation", "top"), Elevation]
Bottom = Annotated[float, Key("elevation", "bottom"), Elevation]


class Strip(Camera):
    """Columns are azimuths at equal steps. A subclass defines how rows follow from elevations."""

    wraps = True

    column_of_forward: Annotated[float, Bounds(ge=-FAR_PX, le=FAR_PX)]
    """Column of the robot's forward: edges of columns count from 0, so the middle is width / 2 (pixels)."""
    _: KW_ONLY
    sense: Sense = "clockwise"
    """Clockwise: what is right of forward follows at higher columns."""
    elevation_top: Top | None = None
    """Elevation of the upper edge (rad). Where not known, elevations are guessed: of square pixels, the horizon in the
    middle."""
    elevation_bottom: Bottom | None = None
    """Elevation of the lower edge (rad)."""

    @abstractmethod
    def level(self, elevations: Array) -> Array:
        """Coordinate of elevations that grows by equal steps from row to row."""

    @abstractmethod
    def elevation_of(self, levels: Array) -> Array:
        """The inverse of `level`."""

    @property
    def elevations(self) -> tuple[float, float]:
        """Elevations of the upper and of the lower edge."""
        if self.elevation_top is None or self.elevation_bottom is None:
            half = min(math.pi * self.height_px / self.width, math.pi / 2)
            return half, -half
        return self.elevation_top, self.elevation_bottom

    @property
    def elevations_known(self) -> bool:
        """Tells whether camera.yaml gives both."""
        return self.elevation_top is not None and self.elevation_bottom is not None

    def project(self, rays: Array) -> tuple[Array, Bools]:
        """Columns from -0.5 to width - 0.5; a row of half a pixel beyond the first or the last is still shown."""
        azimuth, elevation = angles(rays)
        around = (azimuth - self.yaw) * (-1.0 if self.sense == "clockwise" else 1.0)
        edge = self.column_of_forward + around * self.width / (2.0 * math.pi)
        top, bottom = self._levels()
        share = (self.level(elevation) - top) / (bottom - top)
        pixels = np.stack([np.mod(edge, self.width) - 0.5, share * self.height_px - 0.5], axis=-1)
        return pixels, (share >= 0.0) & (share <= 1.0)

    def unproject(self, pixels: Array) -> tuple[Array, Bools]:
        """Any column and row has a direction."""
        sign = -1.0 if self.sense == "clockwise" else 1.0
        azimuth = sign * 2.0 * math.pi * (pixels[..., 0] + 0.5 - self.column_of_forward) / self.width + self.yaw
        top, bottom = self._levels()
        elevation = self.elevation_of(top + (bottom - top) * (pixels[..., 1] + 0.5) / self.height_px)
        return unit_vectors(azimuth, elevation), np.ones(azimuth.shape, np.bool_)

    def _levels(self) -> tuple[float, float]:
        top, bottom = self.level(np.array(self.elevations)).tolist()
        return top, bottom
