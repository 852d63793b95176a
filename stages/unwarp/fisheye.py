"""Unwarps the picture of an equidistant fisheye lens that looks up."""

import math
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.pipeline.problems import BadInput
from omninav.stages.values.camera import Camera, Fisheye
from omninav.stages.values.image import Image, Panorama, column_azimuths

from .table import LastTable, Table, fixed_point


def fisheye_table(camera: Fisheye, columns: int, rows: int) -> Table:
    """Rows are equal steps of elevation between the picture's inner and outer radius; the axis is the zenith."""
    radius = camera.inner_radius_px + (camera.outer_radius_px - camera.inner_radius_px) * (np.arange(rows) + 0.5) / rows
    bearing = column_azimuths(columns) - camera.yaw
    sign = 1.0 if camera.sense == "clockwise" else -1.0
    u = camera.centre_x + radius[:, None] * np.cos(bearing)
    v = camera.centre_y + sign * radius[:, None] * np.sin(bearing)
    top = math.pi / 2 - camera.inner_radius_px / camera.focal_px
    bottom = math.pi / 2 - camera.outer_radius_px / camera.focal_px
    return fixed_point(u, v, top, bottom)


class FisheyeUnwarp(Stage):
    """Panorama from an upward fisheye lens (equidistant: radius = focal_px x angle from the axis).

    Raises BadInput where the recording's camera is another one.
    """

    columns: Annotated[int, Bounds(ge=8)] = 360
    rows: Annotated[int, Bounds(ge=1)] = 80

    class Out(Outputs):
        """The picture, unwarped."""

        panorama: Panorama

    def setup(self, ctx: Context) -> None:
        """No table yet: the camera comes with the first picture."""
        self._tables = LastTable(self._table)

    def _table(self, camera: Camera) -> Table:
        if not isinstance(camera, Fisheye):
            raise BadInput(
                f"unwarp: this recording's camera is a {type(camera).__name__}, not a Fisheye; use unwarp=by_camera"
            )
        return fisheye_table(camera, self.columns, self.rows)

    def step(self, ctx: Context, image: Image, camera: Camera) -> Out:
        """Remap one picture."""
        return self.Out(panorama=self._tables.apply(image, camera))
