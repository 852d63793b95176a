"""Spread of a belief over time."""

import numpy as np

from omninav.stages.geometry.probability.gaussians import moments
from omninav.stages.geometry.probability.particles import weighted_moments
from omninav.stages.values.belief import GaussianMixture, Particles, PlaceBelief


def spread_m(belief: Particles | GaussianMixture | PlaceBelief) -> float:
    """Standard deviation (m) of the distance from the belief's mean; NaN of an empty one."""
    if isinstance(belief, GaussianMixture):
        if not len(belief):
            return float("nan")
        _, covariance, _ = moments(belief.means, belief.covariances, belief.weights)
    else:
        if not len(belief.poses):
            return float("nan")
        weights = belief.probabilities if isinstance(belief, PlaceBelief) else belief.weights
        _, covariance = weighted_moments(belief.poses, weights)
    return float(np.sqrt(max(covariance[0, 0] + covariance[1, 1], 0.0)))
