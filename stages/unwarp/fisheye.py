"""Unwarps the picture of an equidistant fisheye lens that looks up."""

import math

import numpy as np

from omninav.stages.camera.models import Camera, Fisheye

from .table import Table, TableUnwarp, fixed_point, other_camera, polar


def fisheye_table(camera: Fisheye, columns: int, rows: int) -> Table:
    """Rows are equal steps of elevation between the picture's inner and outer radius; the axis is the zenith."""
    radius = camera.inner_radius_px + (camera.outer_radius_px - camera.inner_radius_px) * (np.arange(rows) + 0.5) / rows
    u, v = polar(camera.centre_x, camera.centre_y, radius, columns, camera.sense, camera.yaw)
    top = math.pi / 2 - camera.inner_radius_px / camera.focal_px
    bottom = math.pi / 2 - camera.outer_radius_px / camera.focal_px
    return fixed_point(u, v, top, bottom)


class FisheyeUnwarp(TableUnwarp):
    """Panorama from an upward fisheye lens (equidistant: radius = focal_px x angle from the axis).

    Raises BadInput where the recording's camera is another one.
    """

    def table(self, camera: Camera) -> Table:
        """Where in its pictures each pixel of the panorama lies."""
        if not isinstance(camera, Fisheye):
            raise other_camera(camera, "a Fisheye")
        return fisheye_table(camera, self.columns, self.rows)
