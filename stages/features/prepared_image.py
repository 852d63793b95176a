"""A picture as wide-baseline features read it: where it shows something, which way is up, where its pixels look."""

import math
from collections.abc import Callable
from typing import NamedTuple, cast

import cv2
import numpy as np
import numpy.typing as npt

from omninav.pipeline.graph.problems import BadInput
from omninav.stages.camera.bearings import camera_bearings, panorama_bearings
from omninav.stages.camera.models import Camera, Cylindrical, Donut, Equirectangular, Fisheye, HyperbolicMirror, Sense
from omninav.stages.values.image import Image, Panorama, Pixels

Array = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]


class Ring(NamedTuple):
    """The part of a picture whose radii are upright lines: centre, radii (pixels); azimuth = sense * angle + yaw."""

    centre_x: float
    centre_y: float
    inner: float
    outer: float
    sense: Sense
    yaw: float


class PreparedImage(NamedTuple):
    """A picture made ready. `pixels` (rows, columns, 3); `seen` (rows, columns): where it shows the world.

    `scale`: pixels of the original per pixel of this one. `ring`: of a mirror image, in these pixels; None: columns are
    upright. `circle`: its left edge goes on at its right one. `bearings` gives the unit vectors (N, 3) of original
    pixels (N, 2).
    """

    pixels: Pixels
    seen: Bools
    scale: float
    ring: Ring | None
    circle: bool
    bearings: Callable[[Array], Array]

    def original(self, points: Array) -> Array:
        """Points (..., 2) of this picture in pixels of the original."""
        return (points + 0.5) * self.scale - 0.5


def ring_of(camera: Camera) -> Ring | None:
    """The ring of a camera that looks up; None for one whose columns are upright.

    Raises BadInput for a donut whose ring is not known.
    """
    match camera:
        case HyperbolicMirror() | Fisheye():
            sense: Sense = camera.sense if isinstance(camera, Fisheye) else "clockwise"
            radii = camera.inner_radius_px, camera.outer_radius_px
            return Ring(camera.centre_x, camera.centre_y, *radii, sense, camera.yaw)
        case Donut(centre_x=float(x), centre_y=float(y), inner_radius_px=float(inner), outer_radius_px=float(outer)):
            return Ring(x, y, inner, outer, camera.sense, camera.yaw)
        case Donut():
            raise BadInput(
                "camera: a donut without centre_x, centre_y, inner_radius_px and outer_radius_px; give them in "
                "camera.yaml, or find features on the panorama: wires.features.image=unwarp.panorama"
            )
        case _:
            return None


def read_picture(picture: Image | Panorama, camera: Camera | None, largest: int) -> PreparedImage:
    """Make a picture ready; one of more than `largest` pixels is made smaller.

    A panorama needs no camera. Raises BadInput for an image without one.
    """
    pixels = picture.pixels
    rows, columns = pixels.shape[:2]
    scale = max(1.0, math.sqrt(rows * columns / largest))
    if isinstance(picture, Panorama):
        ring, circle = None, True

        def bearings(points: Array) -> Array:
            return panorama_bearings(points, (rows, columns), picture.elevation_top, picture.elevation_bottom)

    elif camera is None:
        raise BadInput("features: a camera's picture without its camera; wire it: wires.features.camera=source.camera")
    else:
        ring, circle = ring_of(camera), isinstance(camera, Cylindrical | Equirectangular)

        def bearings(points: Array) -> Array:
            return camera_bearings(points, camera)

    if scale > 1.0:
        size = round(columns / scale), round(rows / scale)
        scale = columns / size[0]
        pixels = cast(Pixels, cv2.resize(pixels, size, interpolation=cv2.INTER_AREA))
    if ring is None:
        seen = np.ones(pixels.shape[:2], np.bool_)
    else:
        middle = (ring.centre_x + 0.5) / scale - 0.5, (ring.centre_y + 0.5) / scale - 0.5
        ring = Ring(*middle, ring.inner / scale, ring.outer / scale, ring.sense, ring.yaw)
        down, right = np.ogrid[: pixels.shape[0], : pixels.shape[1]]
        radius = np.hypot(right - ring.centre_x, down - ring.centre_y)
        seen = (radius >= ring.inner) & (radius <= ring.outer)
    return PreparedImage(pixels, seen, scale, ring, circle, bearings)
