"""Unwarps the image of any camera that sees the full circle, by the camera's model."""

from typing import Annotated

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.camera.model import Camera
from omninav.stages.values.image import Image, Panorama

from .table import PanoramaTable


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
        """The full circle."""

        panorama: Panorama

    def setup(self, ctx: Context) -> None:
        """No table yet: the camera comes with the first image."""
        self._table = PanoramaTable(self.columns, self.rows)

    def step(self, ctx: Context, image: Image, camera: Camera) -> Out:
        """Remap one image."""
        return self.Out(panorama=self._table.panorama(image, camera))
