"""A camera's image made small, for people to look at."""

import math
from typing import NamedTuple

import cv2
import numpy as np

from omninav.stages.geometry.arrays import Array, Floats
from omninav.stages.values.image import Pixels
from omninav.stages.values.thumbnails import encoded

from .model import Camera


class Thumbnail(NamedTuple):
    """`pixels` of the part of an image that begins at `corner` (column, row), `scale` times as large."""

    pixels: Pixels
    scale: float
    corner: tuple[int, int]

    def points(self, points: Array) -> Floats:
        """Points (N, 2) of the whole image, columns and rows, in this one's pixels."""
        return ((points - self.corner + 0.5) * self.scale - 0.5).astype(np.float32)

    def jpeg(self, quality: int) -> bytes:
        """It as JPEG bytes."""
        return encoded(self.pixels, quality)


def thumbnail(pixels: Pixels, camera: Camera | None, columns: int) -> Thumbnail:
    """An image (rows, columns, 3) of at most this many columns; of a mirror's or a lens's the disc alone."""
    left, right, top, bottom = used_part(camera, pixels.shape)
    part = pixels[top:bottom, left:right]
    scale = min(1.0, columns / part.shape[1])
    if scale < 1.0:
        size = columns, max(1, round(part.shape[0] * columns / part.shape[1]))
        part = np.asarray(cv2.resize(part, size, interpolation=cv2.INTER_AREA), np.uint8)
    return Thumbnail(part, scale, (left, top))


def used_part(camera: Camera | None, shape: tuple[int, ...]) -> tuple[int, int, int, int]:
    """Columns from, to and rows from, to (ends excluded) that show anything: a mirror's or a lens's disc, else all."""
    rows, columns = shape[:2]
    ring = None if camera is None else camera.ring
    if ring is None:
        return 0, columns, 0, rows
    x, y, radius = ring.centre_x, ring.centre_y, ring.outer
    low_x, high_x = max(0, math.floor(x - radius)), min(columns, math.ceil(x + radius) + 1)
    low_y, high_y = max(0, math.floor(y - radius)), min(rows, math.ceil(y + radius) + 1)
    return (low_x, high_x, low_y, high_y) if low_x < high_x and low_y < high_y else (0, columns, 0, rows)
