"""Brings an equirectangular picture into the common form, cut to a range of elevations."""

import math
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds
from omninav.pipeline.graph.problems import BadInput
from omninav.stages.camera.models import Camera, Equirectangular
from omninav.stages.camera.rays import strip_columns
from omninav.stages.values.image import column_azimuths

from .table import Table, TableUnwarp, fixed_point, other_camera


def equirectangular_table(
    camera: Equirectangular, columns: int, rows: int, highest: float = math.pi / 2, lowest: float = -math.pi / 2
) -> Table:
    """Rows are equal steps of elevation (radians) from `highest` to `lowest`, within what the picture shows."""
    top, bottom = min(camera.elevation_top, highest), max(camera.elevation_bottom, lowest)
    if top <= bottom:
        raise BadInput(
            f"unwarp: the picture shows elevations {math.degrees(camera.elevation_bottom):g} to "
            f"{math.degrees(camera.elevation_top):g} deg, none of them between {math.degrees(lowest):g} and "
            f"{math.degrees(highest):g}; set nodes.unwarp.highest_deg and lowest_deg"
        )
    elevation = top + (bottom - top) * (np.arange(rows) + 0.5) / rows
    per_row = (camera.elevation_bottom - camera.elevation_top) / camera.height_px
    v = np.clip((elevation - camera.elevation_top) / per_row - 0.5, 0.0, camera.height_px - 1.0)
    u_all, v_all = np.meshgrid(strip_columns(camera, column_azimuths(columns)), v)
    return fixed_point(u_all, v_all, top, bottom, wraps=True)


class EquirectangularUnwarp(TableUnwarp):
    """Panorama from an equirectangular picture, cut to the elevations from `lowest_deg` to `highest_deg`.

    Raises BadInput where the recording's camera is another one, or shows none of these elevations.
    """

    highest_deg: Annotated[float, Bounds(ge=-90, le=90)] = 90.0
    lowest_deg: Annotated[float, Bounds(ge=-90, le=90)] = -90.0

    def table(self, camera: Camera) -> Table:
        """Where in its pictures each pixel of the panorama lies."""
        if not isinstance(camera, Equirectangular):
            raise other_camera(camera, "an Equirectangular one")
        limits = math.radians(self.highest_deg), math.radians(self.lowest_deg)
        return equirectangular_table(camera, self.columns, self.rows, *limits)
