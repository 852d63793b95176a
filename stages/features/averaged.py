"""Describes whole views by an averaged strip, without compression."""

from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Stage
from omninav.stages.values.image import Panorama
from omninav.stages.values.views import Coefficients

from .averaged_strip import AveragedStrip


class AveragedView(AveragedStrip, Stage):
    """Describes a view by its averaged panorama, column by column clockwise from straight behind.

    Projections are learned from it (`mapping.principal_components`). Distances are root sums of squares over the strip.
    """

    headings: Annotated[int, Bounds(ge=1)] = 1
    """Headings at which views are compared; must divide `columns`. 1: as they are."""

    def step(self, ctx: Context, panorama: Panorama) -> AveragedStrip.Out:
        strip = self.strip(panorama)
        values = np.moveaxis(strip, 1, 0).ravel()
        turn = len(values) // self.headings
        turned = np.stack([np.roll(values, turn * heading) for heading in range(self.headings)])
        return self.Out(view=Coefficients(values, turned))
