"""Weighs predicted particles by the view and resamples them."""

import math
from typing import Annotated, Literal

import numpy as np
import numpy.typing as npt
from scipy.special import ndtri

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.geometry.probability.particles import effective_size, occupied_cells, systematic
from omninav.stages.values.belief import Likelihood, Particles

Array = npt.NDArray[np.float64]


def kld_number(cells: int, error: float, confidence: float) -> int:
    """Samples needed that the belief lies within `error` (K-L distance) with `confidence`, given the cells it fills.

    Fox 2001: n = (k - 1) / (2 error) (1 - 2 / (9 (k - 1)) + sqrt(2 / (9 (k - 1))) z)^3, z the normal quantile.
    """
    if cells < 2:
        return 1
    part = 2.0 / (9.0 * (cells - 1))
    return math.ceil((cells - 1) / (2.0 * error) * (1.0 - part + math.sqrt(part) * float(ndtri(confidence))) ** 3)


class ImportanceResampling(Stage):
    """Importance weights, then systematic resampling where few particles carry the weight.

    Gross & Koenig 2004, section 2 (5000 samples for global localisation, 500 for tracking). Weights are multiplied by
    the likelihood; below an effective size of `resample_below` times the number, particles are resampled.

    Against kidnapping: with probability `kidnapped` per picture of fresh evidence the robot was put anywhere. What a
    uniform belief would then get, kidnapped x fresh x `likelihood.anywhere`, goes to the `proposals`, poses that the
    view itself suggests. They join the particles set `aside` (a share of `number`), which are resampled among
    themselves, by how well they fit the view, so that a hypothesis lives however little it weighs, and evidence for it
    adds up from picture to picture. As soon as they weigh more than their share, they are resampled with all others.
    It is one mixture, with weights that are right throughout; only where the particles go is decided apart.

    `adapt`: `kld` sets the number between `tracking` and `number` by the cells of `cell_m`, `cell_deg` the belief fills
    (Fox 2001; `kld_error`, 99 % confidence); `none` keeps `number`.
    """

    number: Annotated[int, Bounds(ge=1)] = 5000
    tracking: Annotated[int, Bounds(ge=1)] = 500
    adapt: Literal["kld", "none"] = "none"
    resample_below: Annotated[float, Bounds(ge=0, le=1)] = 0.5
    kidnapped: Annotated[float, Bounds(ge=0, lt=1)] = 1e-7
    aside: Annotated[float, Bounds(ge=0, lt=1)] = 0.1
    kld_error: Annotated[float, Bounds(gt=0)] = 0.05
    cell_m: Annotated[float, Bounds(gt=0)] = 0.25
    cell_deg: Annotated[float, Bounds(gt=0)] = 10.0

    class Out(Outputs):
        """The belief after the picture."""

        belief: Particles

    def step(self, ctx: Context, particles: Particles, likelihood: Likelihood, proposals: Particles | None) -> Out:
        """Fuse prediction and observation."""
        poses, known = particles.poses, particles.weights * likelihood.values
        total, new = float(known.sum()), 0.0
        if not (math.isfinite(total) and total > 0.0):
            ctx.count("belief_without_support", detail="fusion: no particle explains the picture; weights kept")
            known, total, proposals = particles.weights, float(particles.weights.sum()), None
        moved = self.kidnapped * likelihood.fresh
        if proposals is not None and likelihood.anywhere is not None:
            new = moved * likelihood.anywhere * float(particles.weights.sum())
            known, total = known * (1.0 - moved), total * (1.0 - moved) + new
        wanted, tracked = self._wanted(poses[: len(poses) - particles.aside]), len(poses) - particles.aside
        weights = known / total
        aside = int(self.aside * wanted) if new > 0.0 else 0
        if float(weights[tracked:].sum()) * wanted > aside:  # it weighs enough to live among the others
            tracked = len(poses)
        main = self._resampled(ctx, poses[:tracked], weights[:tracked], wanted - aside)
        if proposals is None or not aside:
            return self.Out(belief=Particles(main[0], main[1] / main[1].sum()))
        others = self._set_aside(
            ctx,
            np.concatenate([poses[tracked:], proposals.poses]),
            np.concatenate([weights[tracked:], proposals.weights * (new / total)]),
            np.concatenate([likelihood.values[tracked:], np.full(len(proposals.poses), likelihood.fresh)]),
            aside,
        )
        both = np.concatenate([main[1], others[1]])
        return self.Out(belief=Particles(np.concatenate([main[0], others[0]]), both / both.sum(), aside))

    def _set_aside(
        self, ctx: Context, poses: Array, weights: Array, fitness: Array, number: int
    ) -> tuple[Array, Array]:
        # Drawn by how well they fit, not by what they weigh (the draw is in the weights): by weight, an old hypothesis
        # would push out each new one before anything could speak for it.
        drawn = systematic(fitness, number, float(ctx.rng.random()))
        return poses[drawn], weights[drawn] / fitness[drawn] * (fitness.sum() / number)

    def _resampled(self, ctx: Context, poses: Array, weights: Array, wanted: int) -> tuple[Array, Array]:
        # The weights keep their sum, which is less than 1 where others are set aside.
        if wanted == len(weights) and effective_size(weights) >= self.resample_below * wanted:
            return poses, weights
        drawn = systematic(weights, wanted, float(ctx.rng.random()))
        return poses[drawn], np.full(wanted, weights.sum() / wanted)

    def _wanted(self, poses: Array) -> int:
        if self.adapt == "none":
            return self.number
        cells = occupied_cells(poses, self.cell_m, math.radians(self.cell_deg))
        return min(max(kld_number(cells, self.kld_error, 0.99), self.tracking), self.number)
