"""A panorama's own camera, so that whoever reads images reads panoramas too."""

from omninav.stages.values.image import Image, Panorama

from .equirectangular import Equirectangular
from .model import Camera


def panorama_camera(panorama: Panorama) -> Equirectangular:
    """The camera that would have taken a panorama; its elevations are a guess where the panorama does not say them."""
    rows, columns = panorama.pixels.shape[:2]
    top, bottom = panorama.elevation_top, panorama.elevation_bottom
    return Equirectangular(columns, rows, columns / 2, elevation_top=top, elevation_bottom=bottom)


def camera_behind(image: Image | Panorama, camera: Camera | None) -> Camera | None:
    """The camera that an image is to be read by: a panorama's own, else the one that is given with it."""
    return panorama_camera(image) if isinstance(image, Panorama) else camera
