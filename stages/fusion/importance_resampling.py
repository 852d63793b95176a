"""Weighs predicted particles by the view and resamples them."""

import math
from typing import Annotated, Literal

import numpy as np
import numpy.typing as npt
from scipy.special import ndtri

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.geometry.particles import effective_size, occupied_cells, systematic
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
    the likelihood; below an effective size of `resample_below` times the number, particles are resampled. Against
    kidnapping, `kidnapped` is the probability per picture that the robot was put anywhere: the `proposals`, poses the
    view itself suggests, then share the weight kidnapped x `likelihood.anywhere`, which is what a uniform belief
    would get; so they win where the belief explains the view badly, and only there.
    `adapt`: `kld` sets the number between `tracking` and `number` by the cells of `cell_m`, `cell_deg` the belief fills
    (Fox 2001; `kld_error`, 99 % confidence); `none` keeps `number`.
    """

    number: Annotated[int, Bounds(ge=1)] = 5000
    tracking: Annotated[int, Bounds(ge=1)] = 500
    adapt: Literal["kld", "none"] = "none"
    resample_below: Annotated[float, Bounds(ge=0, le=1)] = 0.5
    kidnapped: Annotated[float, Bounds(ge=0, lt=1)] = 1e-7
    kld_error: Annotated[float, Bounds(gt=0)] = 0.05
    cell_m: Annotated[float, Bounds(gt=0)] = 0.25
    cell_deg: Annotated[float, Bounds(gt=0)] = 10.0

    class Out(Outputs):
        """The belief after the picture."""

        belief: Particles

    def step(self, ctx: Context, particles: Particles, likelihood: Likelihood, proposals: Particles | None) -> Out:
        """Fuse prediction and observation."""
        poses, weights = particles.poses, particles.weights * likelihood.values * (1.0 - self.kidnapped)
        if proposals is not None and likelihood.anywhere is not None and self.kidnapped > 0.0:
            # Drawn from the view itself, they carry the evidence for "anywhere" in equal parts.
            number = len(proposals.poses)
            anywhere = self.kidnapped * likelihood.anywhere * float(particles.weights.sum())
            poses = np.concatenate([poses, proposals.poses])
            weights = np.concatenate([weights, np.full(number, anywhere / number)])
        total = float(weights.sum())
        if not (math.isfinite(total) and total > 0.0):
            ctx.count("belief_without_support", detail="fusion: no particle explains the picture; weights kept")
            poses, weights, total = particles.poses, particles.weights, float(particles.weights.sum())
        weights = weights / total
        wanted = self._wanted(particles.poses)
        known = weights[: len(particles.poses)]
        moved_away = 1.0 - float(known.sum())
        rich = effective_size(known) >= self.resample_below * wanted
        if wanted == len(known) and rich and moved_away * wanted < 1.0:
            return self.Out(belief=Particles(particles.poses, known / known.sum()))
        drawn = systematic(weights, wanted, float(ctx.rng.random()))
        return self.Out(belief=Particles(poses[drawn], np.full(wanted, 1.0 / wanted)))

    def _wanted(self, poses: Array) -> int:
        if self.adapt == "none":
            return self.number
        cells = occupied_cells(poses, self.cell_m, math.radians(self.cell_deg))
        return min(max(kld_number(cells, self.kld_error, 0.99), self.tracking), self.number)
