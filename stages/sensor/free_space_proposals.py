"""Proposes poses anywhere in the free space, for recovery from kidnapping."""

import numpy as np

from omninav.pipeline import Context, Outputs, Stage, Tick
from omninav.stages.values.belief import Particles
from omninav.stages.values.grid import FreeSpace
from omninav.stages.values.track import Track

NUMBER = 100
"""Poses proposed at each image."""


class FreeSpaceProposals(Stage):
    """Draws poses uniformly over the free space with all headings, again at each image.

    Wolf, Burgard & Burkhardt 2005, section III: random samples. All poses have equal weights.
    """

    class Out(Outputs):
        """Poses of equal weights; absent while the track is unbroken."""

        proposals: Particles | None = None

    def step(self, ctx: Context, tick: Tick, free: FreeSpace, track: Track | None = None) -> Out:
        """Propose poses for one image: `tick` is read so that others are drawn for the next."""
        if track is not None and track.unbroken:
            return self.Out()
        return self.Out(proposals=Particles(free.draw(ctx.rng, NUMBER), np.full(NUMBER, 1.0 / NUMBER)))
