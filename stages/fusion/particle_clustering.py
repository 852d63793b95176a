"""Particles as a few Gaussians."""

import math
from typing import Annotated

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.geometry.probability.clusters import clusters
from omninav.stages.geometry.probability.gaussians import floored
from omninav.stages.geometry.probability.particles import weighted_moments
from omninav.stages.values.belief import GaussianMixture, Particles

Array = npt.NDArray[np.float64]


class ParticleClustering(Stage):
    """Particles that lie close together become one Gaussian: its mean, its spread, the sum of their weights.

    Porta & Kroese 2004, section 3.2. Close means: in the same cell of `close_m` by `close_deg`, or in cells that touch,
    and so on from cell to cell; so a cluster has any shape, and it takes an empty cell to part two. Gaussians below
    `least_weight` are not considered (0.01); the others' weights are made to sum to 1. The heading's mean is circular.
    Standard deviations are never less than `floor_m` and `floor_deg`: of particles that are all equal there is no
    spread to compute (erratum 18). Where nothing weighs enough there is none: nobody knows where the robot is.
    """

    close_m: Annotated[float, Bounds(gt=0)] = 0.5
    close_deg: Annotated[float, Bounds(gt=0, le=120)] = 30.0
    least_weight: Annotated[float, Bounds(ge=0, lt=1)] = 0.01
    floor_m: Annotated[float, Bounds(gt=0)] = 0.01
    floor_deg: Annotated[float, Bounds(gt=0)] = 0.5

    class Out(Outputs):
        """The belief as Gaussians; without any where none weighs enough."""

        state: GaussianMixture

    def step(self, ctx: Context, particles: Particles) -> Out:
        """Gather the particles."""
        floor = (self.floor_m, self.floor_m, math.radians(self.floor_deg))
        close = (self.close_m, math.radians(self.close_deg))
        return self.Out(state=gathered(particles, close, self.least_weight, floor))


def gathered(
    particles: Particles, close: tuple[float, float], least_weight: float, floor: tuple[float, float, float]
) -> GaussianMixture:
    """Clusters of particles as Gaussians, heaviest first; weights sum to 1 (see `Clusters`)."""
    total = float(particles.weights.sum())
    labels = clusters(particles.poses, *close)
    weights = np.bincount(labels, weights=particles.weights) / total
    chosen = [n for n in np.argsort(-weights, kind="stable") if weights[n] >= least_weight]
    means, covariances = np.empty((len(chosen), 3)), np.empty((len(chosen), 3, 3))
    for row, cluster in enumerate(chosen):
        members = labels == cluster
        mean, covariance = weighted_moments(particles.poses[members], particles.weights[members])
        means[row], covariances[row] = mean, floored(covariance, floor)
    kept = weights[chosen]
    return GaussianMixture(means, covariances, kept / kept.sum() if len(kept) else kept)
