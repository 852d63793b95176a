"""Remap tables: where in a camera's image each pixel of another image lies, in OpenCV's fixed point."""

from typing import NamedTuple, cast

import cv2
import numpy as np
import numpy.typing as npt

from omninav.pipeline import BadInput
from omninav.stages.camera.model import Array, Bools, Camera
from omninav.stages.camera.rays import unit_vectors
from omninav.stages.values.image import Image, Panorama, Pixels, column_azimuths


class RemapTable(NamedTuple):
    """As for `cv2.remap`: `whole` (rows, columns, 2) int16 and `part` (rows, columns) uint16.

    `wraps`: columns beyond the image's left or right edge continue at the other one (it is itself a full circle).
    """

    whole: npt.NDArray[np.int16]
    part: npt.NDArray[np.uint16]
    wraps: bool

    def remap(self, pixels: Pixels) -> Pixels:
        """Another image made of this one; what lies outside of it is black."""
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


class PanoramaTable:
    """Makes a camera's images panoramas; the table is built once per camera, and not once per image."""

    def __init__(self, columns: int, rows: int) -> None:
        self._size = columns, rows
        self._camera: Camera | None = None

    def panorama(self, image: Image, camera: Camera) -> Panorama:
        """The panorama of an image that `camera` took.

        Columns are equal steps of azimuth, rows equal steps of elevation over all that the camera sees. Raises BadInput
        for a camera that does not see the full circle.
        """
        if camera is not self._camera:
            self._build(camera)
        return Panorama(self._table.remap(image.pixels), *self._edges)

    def _build(self, camera: Camera) -> None:
        columns, rows = self._size
        seen = camera.elevations
        if seen is None:
            raise BadInput(
                f"camera: a {camera.projection} camera does not see the full circle, so that it makes no panorama; "
                "type unwarp=window (its images as they are), or take an omnidirectional one"
            )
        top, bottom = seen
        elevations = top + (bottom - top) * (np.arange(rows) + 0.5) / rows
        self._table, _ = remap_table(camera, unit_vectors(column_azimuths(columns), elevations[:, None]))
        self._edges = seen if camera.elevations_known else (None, None)
        self._camera = camera
