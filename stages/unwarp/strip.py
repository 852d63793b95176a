"""Brings a finished strip of the full circle into the common form."""

import numpy as np

from omninav.stages.camera.models import Camera, Cylindrical
from omninav.stages.camera.rays import strip_columns
from omninav.stages.values.image import column_azimuths

from .table import Table, TableUnwarp, fixed_point, other_camera


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
