"""Whole views as they are, averaged to a small strip."""

from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.values.image import Panorama
from omninav.stages.values.views import Coefficients

from .strip import Channels, Contrast, averaged_strip


class AveragedView(Stage):
    """The averaged panorama itself, not compressed: column by column from straight behind, clockwise.

    What a projection is learned from (`mapping=principal_components`), and the measure of what one loses: distances are
    root sums of squares over `rows` x `columns` of brightness or colour. `contrast`: strip.averaged_strip. `headings`,
    which must divide `columns`: at how many turns views are compared.
    """

    rows: Annotated[int, Bounds(ge=1)] = 16
    columns: Annotated[int, Bounds(ge=1)] = 72
    channels: Channels = "brightness"
    contrast: Contrast = "local"
    headings: Annotated[int, Bounds(ge=1)] = 1

    class Out(Outputs):
        """The description of the view."""

        view: Coefficients

    def __post_init__(self) -> None:
        """Headings are whole columns apart."""
        if self.columns % self.headings:
            raise ValueError(f"headings: {self.headings} do not divide {self.columns} columns; write columns: 72")

    def step(self, ctx: Context, panorama: Panorama) -> Out:
        """Describe one panorama."""
        strip = averaged_strip(panorama.pixels, self.rows, self.columns, self.channels, self.contrast)
        values = np.moveaxis(strip, 1, 0).ravel()
        turn = len(values) // self.headings
        turned = np.stack([np.roll(values, turn * heading) for heading in range(self.headings)])
        return self.Out(view=Coefficients(values, turned))
