"""A finished panorama: azimuths and elevations at equal steps."""

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
