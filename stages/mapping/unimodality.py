"""Tests whether a state is unimodal."""

import numpy as np

from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.probability.gaussians import moments, squared_distances
from omninav.stages.values.belief import GaussianMixture


def unimodal_state(
    state: GaussianMixture, min_share: float = 0.5, near_below: float = 7.81
) -> tuple[Array, Array] | None:
    """Mean (3,) and covariance (3, 3) of a unimodal state, else None.

    Unimodal: the components nearer to the heaviest than `near_below` (squared Mahalanobis distance) hold more than
    `min_share` of the weight. The moments are theirs.
    """
    if not len(state):
        return None
    top = int(np.argmax(state.weights))
    centre = (state.means[top : top + 1], state.covariances[top : top + 1])
    near = squared_distances(*centre, state.means, state.covariances)[0] <= near_below
    if state.weights[near].sum() <= min_share * state.weights.sum():
        return None
    mean, covariance, _ = moments(state.means[near], state.covariances[near], state.weights[near])
    return mean, covariance
