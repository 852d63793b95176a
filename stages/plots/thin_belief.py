"""A belief in few particles or Gaussians, small enough to be kept for every frame."""

import numpy as np

from omninav.pipeline import Context, Outputs, Stage
from omninav.stages.values.belief import Belief, GaussianMixture, Particles, PoseEstimate

PARTICLES = 300
"""Largest number of particles or Gaussians."""


class ThinBelief(Stage):
    """Thins a belief to a few equally weighted particles, chosen without random numbers.

    Of a mixture, as many of its heaviest Gaussians. Any other belief becomes the one pose of its estimate.
    """

    class Out(Outputs):
        """`belief`: particles or Gaussians, map frame; absent where another belief has no estimate."""

        belief: Particles | GaussianMixture | None = None

    def step(self, ctx: Context, belief: Belief, estimate: PoseEstimate | None = None) -> Out:
        if isinstance(belief, Particles):
            return self.Out(belief=thin(belief, PARTICLES))
        if isinstance(belief, GaussianMixture):
            return self.Out(belief=heaviest(belief, PARTICLES))
        if estimate is None:
            return self.Out()
        pose = estimate.pose
        return self.Out(belief=Particles(np.array([[pose.x, pose.y, pose.heading]]), np.ones(1)))


def thin(belief: Particles, particles: int) -> Particles:
    """Systematic choice by weight at the middles of `particles` equal shares; fewer particles are given as they are."""
    if len(belief.weights) <= particles:
        return belief
    edges = belief.weights.cumsum()
    middles = (np.arange(particles) + 0.5) / particles * edges[-1]
    chosen = np.minimum(edges.searchsorted(middles), len(edges) - 1)
    return Particles(belief.poses[chosen], np.full(particles, 1 / particles))


def heaviest(belief: GaussianMixture, components: int) -> GaussianMixture:
    """The mixture's `components` heaviest Gaussians in their order, with the weights that they have."""
    if len(belief) <= components:
        return belief
    kept = np.sort(np.argsort(-belief.weights, kind="stable")[:components])
    return GaussianMixture(belief.means[kept], belief.covariances[kept], belief.weights[kept])
