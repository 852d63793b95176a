"""Brings a finished strip of the full circle into the common form."""

import math
from typing import Annotated

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.pipeline.problems import BadInput
from omninav.stages.values.camera import Camera, Cylindrical, Equirectangular
from omninav.stages.values.image import Image, Panorama, column_azimuths

from .table import LastTable, Table, fixed_point

Array = npt.NDArray[np.float64]


def strip_columns(camera: Cylindrical | Equirectangular, columns: int) -> Array:
    """The strip's column (pixel centres at integers) that looks along each column of the panorama: (columns,)."""
    turned = column_azimuths(columns) * (-1.0 if camera.sense == "clockwise" else 1.0)
    edge = camera.column_of_forward + turned * camera.width / (2.0 * math.pi)
    return np.mod(edge, camera.width) - 0.5


def strip_table(camera: Cylindrical, columns: int, rows: int) -> Table:
    """Rolled so that forward is in the middle, mirrored where needed, all of the strip's rows resampled to `rows`."""
    u = strip_columns(camera, columns)
    v = np.clip((np.arange(rows) + 0.5) * camera.height_px / rows - 0.5, 0.0, camera.height_px - 1.0)
    u_all, v_all = np.meshgrid(u, v)
    return fixed_point(u_all, v_all, camera.elevation_top, camera.elevation_bottom, wraps=True)


class StripUnwarp(Stage):
    """Panorama from a finished strip: rolled or mirrored to the common form and resampled.

    Raises BadInput where the recording's camera is not a strip (`projection: cylindrical`).
    """

    columns: Annotated[int, Bounds(ge=8)] = 360
    rows: Annotated[int, Bounds(ge=1)] = 80

    class Out(Outputs):
        """The strip in the common form."""

        panorama: Panorama

    def setup(self, ctx: Context) -> None:
        """No table yet: the camera comes with the first picture."""
        self._tables = LastTable(self._table)

    def _table(self, camera: Camera) -> Table:
        if not isinstance(camera, Cylindrical):
            raise BadInput(
                f"unwarp: this recording's camera is a {type(camera).__name__}, not a Cylindrical strip; "
                "use unwarp=by_camera"
            )
        return strip_table(camera, self.columns, self.rows)

    def step(self, ctx: Context, image: Image, camera: Camera) -> Out:
        """Resample one strip."""
        return self.Out(panorama=self._tables.apply(image, camera))
