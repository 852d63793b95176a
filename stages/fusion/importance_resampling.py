"""Weights predicted particles by the view and resamples them."""

import math
from typing import Annotated, Literal

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.probability.particles import effective_size, is_narrow, occupied_cells, systematic
from omninav.stages.values.belief import Likelihood, Particles
from omninav.stages.values.commands import Reinitialise

KLD_ERROR = 0.05
"""Kullback-Leibler distance allowed with `adapt: kld` (Fox 2001)."""
MIN_PARTICLES = 500
"""Particles, at least, with `adapt: kld`; the paper's number for tracking."""
CELL_M = 0.25
"""Width of the cells counted with `adapt: kld`, metres."""
CELL_DEG = 10.0
"""Height of a cell in heading, degrees."""
NARROW_M = 1.0
"""Largest standard deviation of the position, metres, of a first belief that its particles represent."""
LEFT_OUT = 0.5
"""Probability of the places that no particle of a wider first belief covers."""


def kld_number(cells: int, error: float, confidence: float) -> int:
    """Samples with which the belief is within `error` (K-L distance) with `confidence`, given its occupied cells.

    Fox 2001: n = (k - 1) / (2 error) (1 - 2 / (9 (k - 1)) + sqrt(2 / (9 (k - 1))) z)^3, z the normal quantile.
    """
    from scipy.special import ndtri  # slow to import: not before a run

    if cells < 2:
        return 1
    part = 2.0 / (9.0 * (cells - 1))
    return math.ceil((cells - 1) / (2.0 * error) * (1.0 - part + math.sqrt(part) * float(ndtri(confidence))) ** 3)


class ImportanceResampling(Stage):
    """Multiplies particle weights by the likelihood; resamples systematically where the effective size is small.

    Gross & Koenig 2004, section 2 (5000 samples for global localisation, 500 for tracking).

    Recovery from kidnapping: the weight that a uniform belief would get, `kidnapping_probability` x novelty (or, if
    that is more, the likelihood's `carried`) x mean likelihood, goes to the `proposals`, poses that the view itself
    suggests. They join the recovery particles, which are resampled among themselves by how well they fit the view, so
    that evidence for a hypothesis accumulates over images however small its weight. Once they outweigh their share they
    are resampled with all others. Weights are those of one mixture throughout; only the allocation of particles
    differs.

    Where a log or a `restart` begins with a belief that may be anywhere, a few thousand particles leave most places
    out, and it would settle on one that looks alike: half of it goes to the poses that the first image suggests.
    """

    number: Annotated[int, Bounds(ge=1)] = 5000
    """Particles, at most."""
    adapt: Literal["kld", "none"] = "none"
    """`kld`: the number follows from the cells that the belief occupies (Fox 2001, 99 % confidence)."""
    resample_below: Annotated[float, Bounds(ge=0, le=1)] = 0.5
    """Effective size, as a share of the number, below which particles are resampled."""
    kidnapping_probability: Annotated[float, Bounds(ge=0, lt=1)] = 1e-7
    """Probability per image of full novelty that the robot was kidnapped; 0: it never was, nor is the start searched
    beyond the particles."""
    recovery_share: Annotated[float, Bounds(ge=0, lt=1)] = 0.1
    """Share of the particles that are recovery particles."""

    class Out(Outputs):
        belief: Particles

    def step(
        self,
        ctx: Context,
        particles: Particles,
        likelihood: Likelihood,
        proposals: Particles | None,
        restart: Reinitialise | None = None,
    ) -> Out:
        poses, weighted = particles.poses, particles.weights * likelihood.values
        total, new = float(np.add.reduce(weighted)), 0.0
        if not (math.isfinite(total) and total > 0.0):
            ctx.count("belief_without_support", detail="fusion: no particle explains the image; weights kept")
            weighted, total, proposals = particles.weights, float(np.add.reduce(particles.weights)), None
        moved = self.kidnapping_probability * likelihood.novelty
        if moved > 0.0:
            moved = max(moved, likelihood.carried)
        begins = ctx.tick.first_of_log or restart is not None
        if begins and moved > 0.0 and not is_narrow(poses, particles.weights, NARROW_M):
            moved = LEFT_OUT
        if proposals is not None and likelihood.mean_likelihood is not None:
            new = moved * likelihood.mean_likelihood * float(np.add.reduce(particles.weights))
            weighted, total = weighted * (1.0 - moved), total * (1.0 - moved) + new
        tracked = len(poses) - particles.recovery_particles
        wanted = self._wanted(poses[:tracked])
        weights = weighted / total
        recovery = int(self.recovery_share * wanted) if new > 0.0 else 0
        if (
            float(np.add.reduce(weights[tracked:])) * wanted > recovery
        ):  # they weigh enough to be resampled with the others
            tracked = len(poses)
        main = self._resampled(ctx, poses[:tracked], weights[:tracked], wanted - recovery)
        if proposals is None or not recovery:
            return self.Out(belief=Particles(main[0], main[1] / np.add.reduce(main[1])))
        # Drawn by fit and corrected in the weights: drawn by weight, old hypotheses would displace new ones before
        # evidence for these could accumulate.
        poses = np.concatenate([poses[tracked:], proposals.poses])
        weights = np.concatenate([weights[tracked:], proposals.weights * (new / total)])
        fitness = np.concatenate([likelihood.values[tracked:], np.full(len(proposals.poses), likelihood.novelty)])
        drawn = systematic(fitness, recovery, float(ctx.rng.random()))
        weights = weights[drawn] / fitness[drawn] * (np.add.reduce(fitness) / recovery)
        both = np.concatenate([main[1], weights])
        return self.Out(belief=Particles(np.concatenate([main[0], poses[drawn]]), both / np.add.reduce(both), recovery))

    def _resampled(self, ctx: Context, poses: Array, weights: Array, wanted: int) -> tuple[Array, Array]:
        # The weights keep their sum, which is below 1 where there are recovery particles.
        if wanted == len(weights) and effective_size(weights) >= self.resample_below * wanted:
            return poses, weights
        drawn = systematic(weights, wanted, float(ctx.rng.random()))
        return poses[drawn], np.full(wanted, np.add.reduce(weights) / wanted)

    def _wanted(self, poses: Array) -> int:
        if self.adapt == "none":
            return self.number
        cells = occupied_cells(poses, CELL_M, math.radians(CELL_DEG))
        return min(max(kld_number(cells, KLD_ERROR, 0.99), MIN_PARTICLES), self.number)
