"""Remap tables: where in a camera's image each pixel of another image is, in OpenCV's fixed point."""

from typing import NamedTuple, cast

import cv2
import numpy as np
import numpy.typing as npt

from omninav.stages.camera.model import Camera
from omninav.stages.geometry.arrays import Array, Bools
from omninav.stages.values.image import Pixels


class RemapTable(NamedTuple):
    """As for `cv2.remap`: `whole` (rows, columns, 2) int16 and `part` (rows, columns) uint16.

    `wraps`: columns beyond the image's left or right edge continue at the other one (it is itself a full circle).
    """

    whole: npt.NDArray[np.int16]
    part: npt.NDArray[np.uint16]
    wraps: bool

    def remap(self, pixels: Pixels) -> Pixels:
        """Another image made of this one; what is outside of it is black."""
        border = cv2.BORDER_WRAP if self.wraps else cv2.BORDER_CONSTANT
        return cast(Pixels, cv2.remap(pixels, self.whole, self.part, cv2.INTER_LINEAR, borderMode=border))


def remap_table(camera: Camera, rays: Array) -> tuple[RemapTable, Bools]:
    """The table of an image whose pixels look along rays (rows, columns, 3), and which of them the camera shows."""
    pixels, shown = camera.project(rays)
    u, v = np.where(shown[..., None], pixels, -10.0).transpose(2, 0, 1).astype(np.float32)
    if camera.wraps:  # the first and the last row have no neighbour to blend with
        v = np.clip(v, 0.0, camera.height_px - 1.0)
    whole, part = cv2.convertMaps(u, v, cv2.CV_16SC2)
    return RemapTable(cast(npt.NDArray[np.int16], whole), cast(npt.NDArray[np.uint16], part), camera.wraps), shown
