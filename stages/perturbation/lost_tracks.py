"""Ends tracks at random."""

from dataclasses import replace
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.values.homing import LOST, TrackedFeatures


class LoseTracks(Stage):
    """Loses a random share of the tracked points, different ones at every tick, to imitate people who walk by.

    The tracker no longer knows where they are: the local map has to find them again (Goedemé et al. 2007, section
    7.2.2).
    """

    share: Annotated[float, Bounds(ge=0, le=1)] = 0.0
    """Probability that a tracked point is lost; 0: nothing is drawn."""

    class Out(Outputs):
        """Absent where nothing is tracked."""

        tracks: TrackedFeatures | None = None

    def step(self, ctx: Context, tracks: TrackedFeatures | None = None) -> Out:
        if tracks is None or self.share == 0.0:
            return self.Out(tracks=tracks)
        lost = ctx.rng.random(len(tracks.rows)) < self.share
        kinds = np.where(lost, LOST, tracks.kinds)
        bearings = np.where(lost[:, None], np.nan, tracks.bearings)
        return self.Out(tracks=replace(tracks, kinds=kinds, bearings=bearings))
