"""Weighs predicted particles by the view, resamples them at every picture, and puts some of them anywhere."""

import math
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.pipeline.problems import BadInput
from omninav.stages.geometry.particles import systematic
from omninav.stages.values.belief import Likelihood, Particles
from omninav.stages.values.grid import FreeSpace


class RandomSamples(Stage):
    """Importance weights, bootstrap resampling at every picture, and random samples against lost or kidnapped robots.

    Wolf, Burgard & Burkhardt 2005, sections III and VI-C: of `number` samples (5000 in the paper) `random` (50) are
    drawn anew at each picture, uniformly over the free space (port `area`) with all headings, instead of that many
    resampled ones, so that the number stays (erratum 47). Resampling is systematic; all weights are equal afterwards.
    Raises BadInput where random samples are wanted and there is no `area`.
    """

    number: Annotated[int, Bounds(ge=1)] = 5000
    random: Annotated[int, Bounds(ge=0)] = 50

    class Out(Outputs):
        """The belief after the picture."""

        belief: Particles

    def step(self, ctx: Context, particles: Particles, likelihood: Likelihood, area: FreeSpace | None = None) -> Out:
        """Fuse prediction and observation."""
        if self.random and area is None:
            raise BadInput(
                "fusion: random samples need a free space to be drawn from; wire fusion.area (occupancy.free), or use "
                "nodes.fusion.random=0"
            )
        weights = particles.weights * likelihood.values
        total = float(weights.sum())
        if not (math.isfinite(total) and total > 0.0):
            ctx.count("belief_without_support", detail="fusion: no particle explains the picture; weights kept")
            weights = particles.weights
        number = min(self.random, self.number)
        poses = np.empty((0, 3))
        if number < self.number:
            poses = particles.poses[systematic(weights, self.number - number, float(ctx.rng.random()))]
        if area is not None and number:
            poses = np.concatenate([poses, area.draw(ctx.rng, number)])
        return self.Out(belief=Particles(poses, np.full(self.number, 1.0 / self.number)))
