"""A finished panorama: azimuths and elevations at equal steps, and the camera that would have taken one."""

import math
from typing import Self

from omninav.stages.geometry.arrays import Array
from omninav.stages.values.image import Image, Panorama

from .model import Camera
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


def panorama_camera(panorama: Panorama) -> Equirectangular:
    """The camera that would have taken a panorama; its elevations are a guess where the panorama has none stated."""
    rows, columns = panorama.pixels.shape[:2]
    top, bottom = panorama.elevation_top, panorama.elevation_bottom
    return Equirectangular(columns, rows, columns / 2, elevation_top=top, elevation_bottom=bottom)


def camera_behind(image: Image | Panorama, camera: Camera | None) -> Camera | None:
    """The camera that an image is to be read by: a panorama's own, else the one that is given with it."""
    return panorama_camera(image) if isinstance(image, Panorama) else camera
