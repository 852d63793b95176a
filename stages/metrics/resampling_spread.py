"""Spread of the particles before and after resampling."""

from collections.abc import Sequence

import numpy as np

from omninav.pipeline import Context, Metrics, MetricSpec, MetricStage
from omninav.stages.geometry.probability.gaussians import density
from omninav.stages.geometry.probability.particles import weighted_moments
from omninav.stages.values.belief import GaussianMixture, Particles

SPECS = {"resampling.ratio": MetricSpec(title="Spread of the particles, after resampling / before")}
AGREE_ABOVE = 0.0001
"""Mean density above which both agree, 1/(m² rad)."""


class ResamplingSpread(MetricStage):
    """Measures the spread of the particles before and after they are resampled, where belief and map agree.

    Porta & Kröse 2004, section 3.1: resampling by pi p(y|x) gives "a concentration of the particles in the
    prior-likelihood intersection". The spread is the root of the summed variances of x and y (m); belief and map agree
    where the particles' mean density under the map's hypothesis is above `AGREE_ABOVE` (as
    `ConditionalResampling` decides).

    Under `resampling`: `frames`, where they agree; `before_m` and `after_m`, the mean spreads there; `ratio`, the
    second over the first. Only `frames` where they never agree.
    """

    def step(
        self,
        ctx: Context,
        predictions: Sequence[Particles | GaussianMixture],
        hypotheses: Sequence[GaussianMixture | None],
        beliefs: Sequence[Particles | GaussianMixture],
    ) -> MetricStage.Out:
        spreads = []
        for before, hypothesis, after in zip(predictions, hypotheses, beliefs, strict=True):
            if hypothesis is None or not isinstance(before, Particles) or not isinstance(after, Particles):
                continue  # a mixture is not resampled
            if agreement(before, hypothesis) > AGREE_ABOVE:
                spreads.append((spread(before), spread(after)))
        values: dict[str, float | int] = {"frames": len(spreads)}
        if spreads:
            before_m, after_m = np.mean(spreads, axis=0)
            values |= {"before_m": float(before_m), "after_m": float(after_m), "ratio": float(after_m / before_m)}
        return self.Out(metrics=Metrics({"resampling": values}, SPECS))


def agreement(particles: Particles, hypothesis: GaussianMixture) -> float:
    """The particles' mean density under a hypothesis whose weights are made to sum to 1: 1/(m^2 rad)."""
    shares = hypothesis.weights / hypothesis.weights.sum()
    return float(particles.weights @ density(particles.poses, hypothesis.means, hypothesis.covariances, shares))


def spread(particles: Particles) -> float:
    """The root of the summed variances of x and y (m)."""
    return float(np.sqrt(np.trace(weighted_moments(particles.poses, particles.weights)[1][:2, :2])))
