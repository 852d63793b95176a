"""A finished strip, as on a cylinder around the camera."""

import numpy as np

from omninav.stages.geometry.arrays import Array

from .strip import Strip


class Cylindrical(Strip, projection="cylindrical"):
    """Columns are azimuths and rows are tangents of elevations, at equal steps.

    Without known elevations rows are whatever they are, and taken for elevations at equal steps.
    """

    def level(self, elevations: Array) -> Array:
        """Their tangents."""
        return np.tan(elevations) if self.elevations_known else elevations

    def elevation_of(self, levels: Array) -> Array:
        """Their arc tangents."""
        return np.arctan(levels) if self.elevations_known else levels
