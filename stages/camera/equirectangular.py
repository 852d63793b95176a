"""A finished panorama: azimuths and elevations at equal steps."""

import math
from typing import Self

from omninav.stages.geometry.arrays import Array

from .strip import Strip


class Equirectangular(Strip, projection="equirectangular"):
    """Columns are azimuths and rows are elevations, at equal steps."""

    def level(self, elevations: Array) -> Array:
        """Themselves."""
        return elevations

    def elevation_of(self, levels: Array) -> Array:
        """Themselves."""
        return levels

    @classmethod
    def of_size(cls, width: int, height: int) -> Self:
        """Forward in the middle: the whole sphere, as 360-degree cameras export it, where the image is twice as wide as
        high; else a part of it around the horizon, of square pixels.
        """
        half = math.pi / 2 if width == 2 * height else None
        return cls(width, height, width / 2, elevation_top=half, elevation_bottom=half and -half)
