"""The columns of any camera's image as warping compares them."""

import math

import cv2
import numpy as np

from omninav.pipeline import BadInput
from omninav.stages.camera.model import Camera, seen_at
from omninav.stages.camera.rays import unit_vectors
from omninav.stages.geometry.arrays import Floats
from omninav.stages.values.image import Pixels

from .min_warping import LOG_STEP, Columns

FINER = 4
"""Samples per column and per row, which are averaged."""
LOWEST_DEG, HIGHEST_DEG = 1.0, 45.0
"""Elevations above and below the horizon that are compared."""


class ColumnTable:
    """Makes a camera's images columns; the table is built once per camera, and not once per image."""

    def __init__(self, columns: int) -> None:
        self._columns = columns
        self._camera: Camera | None = None

    def columns(self, pixels: Pixels, camera: Camera) -> Columns:
        """The columns of an image that `camera` took.

        Raises BadInput for a camera that does not see the full circle, or nothing near the horizon.
        """
        if camera is not self._camera:
            self._places = [_places(camera, self._columns, side) for side in (1.0, -1.0)]
            if not any(len(places) for places in self._places):
                raise BadInput(
                    f"warping: this {camera.projection} camera shows less than a full circle within {HIGHEST_DEG:g} "
                    "degrees of the horizon; take an omnidirectional one"
                )
            self._camera = camera
        return Columns(*(self._sampled(pixels, places, camera) for places in self._places))

    def _sampled(self, pixels: Pixels, places: Floats, camera: Camera) -> Floats:
        rows = len(places) // FINER
        if not rows:
            return np.zeros((self._columns, 0, 3), np.float32)
        border = cv2.BORDER_WRAP if camera.wraps else cv2.BORDER_CONSTANT
        fine = cv2.remap(pixels, places, None, cv2.INTER_LINEAR, borderMode=border)  # type: ignore[call-overload]
        mean = cv2.resize(fine.astype(np.float32), (self._columns, rows), interpolation=cv2.INTER_AREA)
        return np.ascontiguousarray(mean.transpose(1, 0, 2) / 255.0, np.float32)


def _places(camera: Camera, columns: int, side: float) -> Floats:
    """Pixels of the samples of the rows on one side of the horizon that are seen all around, outwards."""
    low, high = (math.log(math.tan(math.radians(degrees))) for degrees in (LOWEST_DEG, HIGHEST_DEG))
    rows = math.floor((high - low) / LOG_STEP) + 1
    offsets = (np.arange(FINER) + 0.5) / FINER - 0.5
    levels = low + LOG_STEP * (np.arange(rows)[:, None] + offsets).ravel()
    azimuths = 2.0 * math.pi / columns * (np.arange(columns)[:, None] + offsets).ravel()
    places = seen_at(camera, unit_vectors(azimuths, side * np.arctan(np.exp(levels))[:, None]))
    if camera.wraps:  # the first and the last row have no neighbour to blend with
        places[..., 1] = np.clip(places[..., 1], 0.0, camera.height_px - 1.0)
    seen = np.isfinite(places.reshape(rows, -1).sum(axis=1))
    first = int(np.argmax(seen))
    rest = np.flatnonzero(~seen[first:])
    last = first + (int(rest[0]) if len(rest) else rows - first)
    return np.ascontiguousarray(places[first * FINER : last * FINER], np.float32)
