"""An image as homing reads it: small, grey, with its pixels' bearings and back."""

import math
from typing import NamedTuple, cast

import cv2
import numpy as np

from omninav.pipeline import BadInput
from omninav.stages.camera.equirectangular import camera_behind
from omninav.stages.camera.model import Camera, require_elevations, seen_at
from omninav.stages.geometry.arrays import Array, Bools, Bytes
from omninav.stages.values.image import Image, Panorama

SEAM = 32
"""Columns of a full circle that are repeated beyond both edges, so that features can be tracked across the seam."""


class WorkingImage(NamedTuple):
    """`grey` (rows, columns), with `seam` columns repeated on both sides; points are columns and rows without them.

    `scale`: pixels of the original per pixel of this one, along columns and rows. `camera`: of the original.
    """

    grey: Bytes
    seam: int
    scale: tuple[float, float]
    camera: Camera

    @property
    def columns(self) -> int:
        """Columns without those repeated."""
        return int(self.grey.shape[1]) - 2 * self.seam

    def bearings(self, points: Array) -> Array:
        """Unit vectors (N, 3) in the robot's frame of points (N, 2)."""
        return self.camera.unproject(self.to_original(points))[0]

    def points(self, rays: Array) -> Array:
        """Points (N, 2) at which rays (N, 3) of any length in the robot's frame are seen; NaN where they are not."""
        return self.from_original(seen_at(self.camera, rays))

    def to_original(self, points: Array) -> Array:
        """Points (N, 2) in pixels of the original."""
        return (points + 0.5) * self.scale - 0.5

    def from_original(self, points: Array) -> Array:
        """Points (N, 2) of the original in pixels of this one."""
        return (points + 0.5) / self.scale - 0.5

    def inside(self, points: Array, margin: float) -> Bools:
        """Which points (N, 2) are finite and `margin` pixels from the edges of `grey`."""
        rows, columns = self.grey.shape
        x, y = points[:, 0] + self.seam, points[:, 1]
        with np.errstate(invalid="ignore"):
            return np.asarray((x >= margin) & (x <= columns - 1 - margin) & (y >= margin) & (y <= rows - 1 - margin))


def working_image(image: Image | Panorama, camera: Camera | None, max_pixels: int) -> WorkingImage:
    """A grey image of at most `max_pixels`. Raises BadInput without its camera, or without the camera's elevations."""
    seen_by = camera_behind(image, camera)
    if seen_by is None:
        raise BadInput("homing: a camera's image without its camera; wire it: wires.tracker.camera=source.camera")
    if isinstance(image, Image):
        require_elevations(seen_by)
    grey = cast(Bytes, cv2.cvtColor(image.pixels, cv2.COLOR_BGR2GRAY))
    rows, columns = grey.shape
    size = columns, rows
    shrink = math.sqrt(rows * columns / max_pixels)
    if shrink > 1.0:
        size = max(1, round(columns / shrink)), max(1, round(rows / shrink))
        grey = cast(Bytes, cv2.resize(grey, size, interpolation=cv2.INTER_AREA))
    seam = min(SEAM, size[0]) if seen_by.wraps else 0
    if seam:
        grey = np.concatenate([grey[:, -seam:], grey, grey[:, :seam]], axis=1)
    return WorkingImage(grey, seam, (columns / size[0], rows / size[1]), seen_by)
