"""Weights predicted particles by the view, resamples them at every image and injects random ones."""

import math
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.geometry.probability.particles import systematic
from omninav.stages.values.belief import Likelihood, Particles

RANDOM_PARTICLES = 50
"""Particles drawn from the proposals at each image, as in the paper (section VI-C)."""


class UniformRecovery(Stage):
    """Bootstrap filter: resamples at every image and replaces some particles by random ones.

    Wolf, Burgard & Burkhardt 2005, sections III and VI-C: random particles let a lost or kidnapped robot recover. They
    are drawn from the `proposals` by weight and take the place of resampled ones, so that the number stays (erratum
    47). With `sensor=visibility` they are uniform over the free space with all headings, as in the paper. Resampling is
    systematic; all weights are equal afterwards.
    """

    number: Annotated[int, Bounds(ge=1)] = 5000
    """Particles."""

    class Out(Outputs):
        belief: Particles

    def step(self, ctx: Context, particles: Particles, likelihood: Likelihood, proposals: Particles | None) -> Out:
        """Fuse prediction and observation; without proposals, as of a robot that was not carried, none is random."""
        weights = particles.weights * likelihood.values
        total = float(weights.sum())
        if not (math.isfinite(total) and total > 0.0):
            ctx.count("belief_without_support", detail="fusion: no particle explains the image; weights kept")
            weights = particles.weights
        random = 0 if proposals is None else min(RANDOM_PARTICLES, self.number)
        poses = np.empty((0, 3))
        if random < self.number:
            poses = particles.poses[systematic(weights, self.number - random, float(ctx.rng.random()))]
        if proposals is not None:
            drawn = systematic(proposals.weights, random, float(ctx.rng.random()))
            poses = np.concatenate([poses, proposals.poses[drawn]])
        return self.Out(belief=Particles(poses, np.full(self.number, 1.0 / self.number)))
