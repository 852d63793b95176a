"""Unwarps the picture of a hyperbolic mirror by the mirror's model."""

import numpy as np

from omninav.pipeline.graph.problems import BadInput
from omninav.stages.camera.catadioptric import back_project, project
from omninav.stages.camera.models import Camera, HyperbolicMirror
from omninav.stages.values.image import column_azimuths

from .table import Table, TableUnwarp, fixed_point, other_camera


def elevation_range(camera: HyperbolicMirror) -> tuple[float, float]:
    """Elevations (radians) seen at the outer and at the inner radius of the mask: (highest, lowest)."""
    radii = np.array([camera.outer_radius_px, camera.inner_radius_px])
    pixels = np.stack([camera.centre_x + radii, np.full(2, camera.centre_y)], axis=-1)
    rays = back_project(
        pixels, camera.focal_x, camera.focal_y, camera.centre_x, camera.centre_y, camera.skew, camera.a, camera.b
    )
    if np.isnan(rays).any():
        raise BadInput(
            f"camera: the mask ({camera.inner_radius_px:g} to {camera.outer_radius_px:g} px) reaches beyond what a "
            f"mirror with a={camera.a:g}, b={camera.b:g} shows; check mask, K and mirror in camera.yaml"
        )
    elevations = np.arcsin(np.clip(rays[:, 2], -1.0, 1.0))
    return float(elevations.max()), float(elevations.min())


def hyperbolic_table(camera: HyperbolicMirror, columns: int, rows: int) -> Table:
    """Columns are equal steps of azimuth, rows equal steps of elevation between the two radii of the mask."""
    top, bottom = elevation_range(camera)
    azimuth = column_azimuths(columns) - camera.yaw
    elevation = top + (bottom - top) * (np.arange(rows) + 0.5) / rows
    rays = np.stack(
        [
            np.cos(elevation)[:, None] * np.cos(azimuth),
            np.cos(elevation)[:, None] * np.sin(azimuth),
            np.broadcast_to(np.sin(elevation)[:, None], (rows, columns)),
        ],
        axis=-1,
    )
    pixels = project(
        rays, camera.focal_x, camera.focal_y, camera.centre_x, camera.centre_y, camera.skew, camera.a, camera.b
    )
    return fixed_point(pixels[..., 0], pixels[..., 1], top, bottom)


class HyperbolicUnwarp(TableUnwarp):
    """Panorama from a hyperbolic mirror by its model: rows are equal steps of elevation.

    Svoboda & Pajdla's model as erratum 33 corrects it; the panorama spans the elevations inside the mask. The table
    is built once per camera. Raises BadInput for any other camera.
    """

    def table(self, camera: Camera) -> Table:
        """Where in its pictures each pixel of the panorama lies."""
        if not isinstance(camera, HyperbolicMirror):
            raise other_camera(camera, "a HyperbolicMirror")
        return hyperbolic_table(camera, self.columns, self.rows)
