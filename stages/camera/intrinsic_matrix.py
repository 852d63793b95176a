"""The matrix K of a camera: from the plane at distance 1 to pixels, and back."""

from dataclasses import KW_ONLY

import numpy as np

from omninav.stages.geometry.arrays import Array

from .model import Camera, CentreX, CentreY, FocalX, FocalY, Skew


class IntrinsicMatrix(Camera):
    """A camera with K = [[focal_x, skew, centre_x], [0, focal_y, centre_y], [0, 0, 1]] (pixels)."""

    focal_x: FocalX
    focal_y: FocalY
    centre_x: CentreX
    centre_y: CentreY
    _: KW_ONLY
    skew: Skew = 0.0

    @property
    def k(self) -> list[float]:
        """The nine numbers of K, row by row."""
        return [self.focal_x, self.skew, self.centre_x, 0.0, self.focal_y, self.centre_y, 0.0, 0.0, 1.0]

    def pixels_of(self, points: Array) -> Array:
        """Pixels (..., 2) of points (..., 2) of the plane."""
        x, y = points[..., 0], points[..., 1]
        with np.errstate(over="ignore", invalid="ignore"):
            u, v = self.focal_x * x + self.skew * y + self.centre_x, self.focal_y * y + self.centre_y
        return np.stack([u, v], axis=-1)

    def points_of(self, pixels: Array) -> Array:
        """The inverse of `pixels_of`."""
        y = (pixels[..., 1] - self.centre_y) / self.focal_y
        x = (pixels[..., 0] - self.centre_x - self.skew * y) / self.focal_x
        return np.stack([x, y], axis=-1)
