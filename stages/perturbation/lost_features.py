"""Features that are not there."""

from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.values.local_features import LocalFeatures


class LostFeatures(Stage):
    """Takes a random share of the features away, others at every tick: what occlusions and light leave of them.

    `share` of 0: all stay, and nothing is drawn.
    """

    share: Annotated[float, Bounds(ge=0, lt=1)] = 0.0

    class Out(Outputs):
        features: LocalFeatures

    def step(self, ctx: Context, features: LocalFeatures) -> Out:
        """What is left of one view's."""
        if self.share == 0.0:
            return self.Out(features=features)
        kept = ctx.rng.random(len(features)) >= self.share
        return self.Out(features=features.chosen(np.flatnonzero(kept)))
