"""An image as wide-baseline features read it: where it shows something, which way is up, where its pixels look."""

import math
from typing import NamedTuple, cast

import cv2
import numpy as np

from omninav.pipeline import BadInput
from omninav.stages.camera.equirectangular import camera_behind
from omninav.stages.camera.model import Camera, Ring
from omninav.stages.camera.rays import angles, unit_vectors
from omninav.stages.geometry.arrays import Array, Bools
from omninav.stages.values.image import Image, Panorama, Pixels

SMALL_ANGLE = 1e-4
"""Step of elevation by which it is found which way is up at a pixel, rad."""


class PreparedImage(NamedTuple):
    """An image made ready. `pixels` (rows, columns, 3); `seen` (rows, columns): where it shows the world.

    `scale` (2,): columns and rows of the original per column and row of this one. `ring`: of a mirror image, in these
    pixels, if it has one. `camera`: of the original.
    """

    pixels: Pixels
    seen: Bools
    scale: Array
    ring: Ring | None
    camera: Camera

    @property
    def circle(self) -> bool:
        """Its left edge continues at its right one."""
        return self.camera.wraps

    def bearings(self, points: Array) -> Array:
        """The unit vectors (..., 3) of points (..., 2) of the original; NaN where it shows nothing."""
        return self.camera.unproject(points)[0]

    def original(self, points: Array) -> Array:
        """Points (..., 2) of this image in pixels of the original."""
        return (points + 0.5) * self.scale - 0.5

    def upward(self, points: Array) -> Array:
        """The way up at points (N, 2) of this image, degrees clockwise from the right: (N,)."""
        if self.ring is not None:
            outward = points - (self.ring.centre_x, self.ring.centre_y)
            right, down = (-outward if self.camera.looks_up else outward).T
        elif self.camera.upright:
            return np.full(len(points), 270.0)
        else:
            azimuths, elevations = angles(self.bearings(self.original(points)))
            below, above = (
                self.camera.project(unit_vectors(azimuths, elevations + step))[0]
                for step in (-SMALL_ANGLE, SMALL_ANGLE)
            )
            right, down = np.nan_to_num((above - below) / self.scale).T
        up: Array = np.degrees(np.arctan2(down, right)) % 360.0
        return up


def prepared_image(image: Image | Panorama, camera: Camera | None, max_pixels: int) -> PreparedImage:
    """Make an image ready; one of more than `max_pixels` pixels is made smaller.

    A panorama needs no camera. Raises BadInput for an image without one.
    """
    seen_by = camera_behind(image, camera)
    if seen_by is None:
        raise BadInput("features: a camera's image without its camera; wire it: wires.features.camera=source.camera")
    pixels, ring = image.pixels, seen_by.ring
    rows, columns = pixels.shape[:2]
    shrink, scale = math.sqrt(rows * columns / max_pixels), np.ones(2)
    if shrink > 1.0:
        size = round(columns / shrink), round(rows / shrink)
        scale = np.array([columns / size[0], rows / size[1]])
        pixels = cast(Pixels, cv2.resize(pixels, size, interpolation=cv2.INTER_AREA))
    read = PreparedImage(pixels, np.ones(pixels.shape[:2], np.bool_), scale, None, seen_by)
    rows_read, columns_read = np.ogrid[: pixels.shape[0], : pixels.shape[1]]
    if ring is not None:
        x, y = (np.array([ring.centre_x, ring.centre_y]) + 0.5) / scale - 0.5
        mean = float(scale.mean())
        ring = Ring(float(x), float(y), ring.inner / mean, ring.outer / mean)
        return read._replace(seen=ring.holds(columns_read, rows_read), ring=ring)
    if not seen_by.upright:
        grid = np.stack(np.broadcast_arrays(columns_read, rows_read), axis=-1)
        return read._replace(seen=seen_by.shows(read.original(grid)))
    return read
