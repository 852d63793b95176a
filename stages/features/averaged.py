"""Whole views as they are, averaged to a small strip."""

from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Stage
from omninav.stages.values.image import Panorama
from omninav.stages.values.views import Coefficients

from .averaged_strip import AveragedStrip


class AveragedView(AveragedStrip, Stage):
    """The averaged panorama itself, not compressed: column by column from straight behind, clockwise.

    What a projection is learned from (`mapping=principal_components`), and the measure of what one loses: distances are
    root sums of squares over `rows` x `columns` of brightness or colour. `contrast`: strip.averaged_strip. `headings`,
    which must divide `columns`: at how many turns views are compared.
    """

    headings: Annotated[int, Bounds(ge=1)] = 1

    def step(self, ctx: Context, panorama: Panorama) -> AveragedStrip.Out:
        """Describe one panorama."""
        strip = self.strip(panorama)
        values = np.moveaxis(strip, 1, 0).ravel()
        turn = len(values) // self.headings
        turned = np.stack([np.roll(values, turn * heading) for heading in range(self.headings)])
        return self.Out(view=Coefficients(values, turned))
