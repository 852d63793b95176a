"""Weights predicted particles by the view, resamples them at every image and injects random ones."""

import math
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.pipeline.graph.problems import BadInput
from omninav.stages.geometry.probability.particles import systematic
from omninav.stages.values.belief import Likelihood, Particles


class UniformRecovery(Stage):
    """Bootstrap filter: resamples at every image and replaces some particles by random ones.

    Wolf, Burgard & Burkhardt 2005, sections III and VI-C: random particles let a lost or kidnapped robot recover. They
    are drawn from the `proposals` by weight and take the place of resampled ones, so that the number stays (erratum
    47). With `sensor=visibility` they are uniform over the free space with all headings, as in the paper. Resampling is
    systematic; all weights are equal afterwards. Raises BadInput where random particles are wanted and there are no
    proposals.
    """

    number: Annotated[int, Bounds(ge=1)] = 5000
    """Particles."""
    random_particles: Annotated[int, Bounds(ge=0)] = 50
    """Particles drawn from the proposals at each image."""

    class Out(Outputs):
        """The belief after the image."""

        belief: Particles

    def step(
        self, ctx: Context, particles: Particles, likelihood: Likelihood, proposals: Particles | None = None
    ) -> Out:
        """Fuse prediction and observation."""
        if self.random_particles and proposals is None:
            raise BadInput(
                "fusion: random particles are drawn from proposals; wire fusion.proposals to a sensor that gives them "
                "(nodes.sensor.proposals above 0), or type nodes.fusion.random_particles=0"
            )
        weights = particles.weights * likelihood.values
        total = float(weights.sum())
        if not (math.isfinite(total) and total > 0.0):
            ctx.count("belief_without_support", detail="fusion: no particle explains the image; weights kept")
            weights = particles.weights
        number = min(self.random_particles, self.number)
        poses = np.empty((0, 3))
        if number < self.number:
            poses = particles.poses[systematic(weights, self.number - number, float(ctx.rng.random()))]
        if proposals is not None and number:
            drawn = systematic(proposals.weights, number, float(ctx.rng.random()))
            poses = np.concatenate([poses, proposals.poses[drawn]])
        return self.Out(belief=Particles(poses, np.full(self.number, 1.0 / self.number)))
