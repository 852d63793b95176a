"""A finished panorama: azimuths and elevations at equal steps."""

import math
from typing import Self

from .model import Array
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
        """The whole sphere with forward in the middle, as 360-degree cameras export it."""
        half = math.pi / 2
        return cls(width, height, width / 2, elevation_top=half, elevation_bottom=-half)
