"""Brings a finished strip of the full circle into the common form."""

import math

import numpy as np
import numpy.typing as npt

from omninav.stages.values.camera import Camera, Cylindrical, Equirectangular
from omninav.stages.values.image import column_azimuths

from .table import Table, TableUnwarp, fixed_point, other_camera

Array = npt.NDArray[np.float64]


def strip_columns(camera: Cylindrical | Equirectangular, azimuths: Array) -> Array:
    """The strip's column (pixel centres at integers) that looks along each azimuth (rad), of the same shape."""
    turned = azimuths * (-1.0 if camera.sense == "clockwise" else 1.0)
    edge = camera.column_of_forward + turned * camera.width / (2.0 * math.pi)
    return np.mod(edge, camera.width) - 0.5


def strip_table(camera: Cylindrical, columns: int, rows: int) -> Table:
    """Rolled so that forward is in the middle, mirrored where needed, all of the strip's rows resampled to `rows`."""
    u = strip_columns(camera, column_azimuths(columns))
    v = np.clip((np.arange(rows) + 0.5) * camera.height_px / rows - 0.5, 0.0, camera.height_px - 1.0)
    u_all, v_all = np.meshgrid(u, v)
    return fixed_point(u_all, v_all, camera.elevation_top, camera.elevation_bottom, wraps=True)


class StripUnwarp(TableUnwarp):
    """Panorama from a finished strip: rolled or mirrored to the common form and resampled.

    Raises BadInput where the recording's camera is not a strip (`projection: cylindrical`).
    """

    def table(self, camera: Camera) -> Table:
        """Where in its pictures each pixel of the panorama lies."""
        if not isinstance(camera, Cylindrical):
            raise other_camera(camera, "a Cylindrical strip")
        return strip_table(camera, self.columns, self.rows)
