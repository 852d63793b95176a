"""Unwarps the image of any camera that sees the full circle, by the camera's model."""

from typing import Annotated

import numpy as np

from omninav.pipeline import BadInput, Bounds, Context, Outputs, Stage
from omninav.stages.camera.model import Camera
from omninav.stages.camera.rays import unit_vectors
from omninav.stages.values.image import Image, Panorama, column_azimuths

from .table import remap_table


class UnwarpPanorama(Stage):
    """Unwarps an image by its camera's model; rows are equal steps of elevation over all that it sees.

    Of a mirror of which no model is known (`donut`) they are equal steps of radius. Raises BadInput where the camera
    does not see the full circle.
    """

    columns: Annotated[int, Bounds(ge=8)] = 360
    """Columns of the panorama (pixels)."""
    rows: Annotated[int, Bounds(ge=1)] = 80
    """Rows of the panorama (pixels)."""

    class Out(Outputs):
        panorama: Panorama

    def setup(self, ctx: Context) -> None:
        """No table yet: the camera comes with the first image."""
        self._camera: Camera | None = None

    def step(self, ctx: Context, image: Image, camera: Camera) -> Out:
        if camera is not self._camera:
            self._build(camera)
        return self.Out(panorama=Panorama(self._table.remap(image.pixels), *self._edges))

    def _build(self, camera: Camera) -> None:
        """Make the table, once per camera: columns are equal steps of azimuth."""
        seen = camera.elevations
        if seen is None:
            raise BadInput(
                f"camera: a {camera.projection} camera does not see the full circle, so that it makes no panorama; "
                "type unwarp=window (its images as they are), or take an omnidirectional one"
            )
        top, bottom = seen
        elevations = top + (bottom - top) * (np.arange(self.rows) + 0.5) / self.rows
        self._table, _ = remap_table(camera, unit_vectors(column_azimuths(self.columns), elevations[:, None]))
        self._edges = seen if camera.elevations_known else (None, None)
        self._camera = camera
