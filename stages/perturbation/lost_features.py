"""Drops features at random."""

from dataclasses import replace
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.values.local_features import LocalFeatures


class LostFeatures(Stage):
    """Drops a random share of the features, different ones at every tick, to imitate occlusion and light.

    Where a view has columns, the same share of them.
    """

    share: Annotated[float, Bounds(ge=0, lt=1)] = 0.0
    """Probability that a feature is dropped; 0: nothing is drawn."""

    class Out(Outputs):
        features: LocalFeatures

    def step(self, ctx: Context, features: LocalFeatures) -> Out:
        if self.share == 0.0:
            return self.Out(features=features)
        kept = ctx.rng.random(len(features)) >= self.share
        thinned = features.chosen(np.flatnonzero(kept))
        if features.columns is not None:
            kept = ctx.rng.random(len(features.columns)) >= self.share
            thinned = replace(thinned, columns=features.columns.chosen(np.flatnonzero(kept)))
        return self.Out(features=thinned)
