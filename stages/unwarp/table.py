"""Remap tables: where in a picture each pixel of a panorama lies, in OpenCV's fixed point; and stages that use one."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Annotated, NamedTuple, cast

import cv2
import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.pipeline.graph.problems import BadInput
from omninav.stages.camera.models import Camera, Sense
from omninav.stages.values.image import Image, Panorama, Pixels, column_azimuths

Array = npt.NDArray[np.float64]
Whole = npt.NDArray[np.int16]
Part = npt.NDArray[np.uint16]


class Table(NamedTuple):
    """A panorama's recipe: `whole` (rows, columns, 2) int16 and `part` (rows, columns) uint16, as for `cv2.remap`.

    The elevations are those of the panorama's upper and lower edge (radians), None where they are not known. `wraps`:
    columns beyond the picture's left or right edge continue at the other one (the picture is itself a full circle).
    """

    whole: Whole
    part: Part
    elevation_top: float | None = None
    elevation_bottom: float | None = None
    wraps: bool = False

    def remapped(self, pixels: Pixels) -> Pixels:
        """Another picture made of this one; what lies outside the picture is black."""
        border = cv2.BORDER_WRAP if self.wraps else cv2.BORDER_CONSTANT
        return cast(Pixels, cv2.remap(pixels, self.whole, self.part, cv2.INTER_LINEAR, borderMode=border))

    def apply(self, pixels: Pixels) -> Panorama:
        """The panorama of a picture; what lies outside the picture is black."""
        return Panorama(self.remapped(pixels), self.elevation_top, self.elevation_bottom)


def fixed_point(
    u: Array, v: Array, top: float | None = None, bottom: float | None = None, wraps: bool = False
) -> Table:
    """A table from the picture's column `u` and row `v` (rows, columns) of each panorama pixel; NaN becomes black."""
    u, v = np.nan_to_num(u, nan=-10.0), np.nan_to_num(v, nan=-10.0)
    whole, part = cv2.convertMaps(u.astype(np.float32), v.astype(np.float32), cv2.CV_16SC2)
    return Table(cast(Whole, whole), cast(Part, part), top, bottom, wraps)


def polar(
    centre_x: float, centre_y: float, radius: Array, columns: int, sense: Sense, yaw: float
) -> tuple[Array, Array]:
    """Column and row in the picture of each pixel of a panorama whose rows are circles of `radius` (rows,) pixels."""
    bearing = column_azimuths(columns) - yaw
    sign = 1.0 if sense == "clockwise" else -1.0
    return centre_x + radius[:, None] * np.cos(bearing), centre_y + sign * radius[:, None] * np.sin(bearing)


class LastTable:
    """Keeps the table of the camera seen last, so that it is built once per camera and not once per picture."""

    def __init__(self, build: Callable[[Camera], Table]) -> None:
        self._build = build
        self._camera: Camera | None = None
        self._table: Table | None = None

    def apply(self, image: Image, camera: Camera) -> Panorama:
        """The panorama of a picture that `camera` took."""
        if camera is not self._camera or self._table is None:
            self._table = self._build(camera)
            self._camera = camera
        return self._table.apply(image.pixels)


class TableUnwarp(Stage, ABC):
    """A panorama by a table that follows from the camera: what the stages for one projection each have in common."""

    columns: Annotated[int, Bounds(ge=8)] = 360
    rows: Annotated[int, Bounds(ge=1)] = 80

    class Out(Outputs):
        """The picture as a panorama."""

        panorama: Panorama

    @abstractmethod
    def table(self, camera: Camera) -> Table:
        """The table of a camera. Raises BadInput where the camera is of another projection."""

    def setup(self, ctx: Context) -> None:
        """No table yet: the camera comes with the first picture."""
        self._tables = LastTable(self.table)

    def step(self, ctx: Context, image: Image, camera: Camera) -> Out:
        """Remap one picture."""
        return self.Out(panorama=self._tables.apply(image, camera))


def other_camera(camera: Camera, wanted: str) -> BadInput:
    """The refusal of a camera by a stage for another projection."""
    return BadInput(f"unwarp: this recording's camera is a {type(camera).__name__}, not {wanted}; use unwarp=by_camera")
