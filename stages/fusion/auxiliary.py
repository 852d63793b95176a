"""The auxiliary particle filter: particles are selected by how well their predicted poses fit the view."""

import numpy as np

from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.plane.odometry_motion import move_poses
from omninav.stages.geometry.probability.gaussians import density
from omninav.stages.geometry.probability.particles import systematic
from omninav.stages.values.belief import GaussianMixture, Particles
from omninav.stages.values.pose import UncertainMotion


def auxiliary_filter(
    before: Particles, model: UncertainMotion, hypothesis: GaussianMixture, floor: float, rng: np.random.Generator
) -> Particles | None:
    """Particles after a motion and a view, by Pitt & Shephard's auxiliary filter (1999; erratum 15 in docs/papers.md).

    `before`: the belief before the motion. First stage: particle i is selected by pi_i p(y|mu_i), where mu_i is its
    pose after the motion without noise. The selected particles move with noise. Second stage: they get the weights
    p(y|x) / p(y|mu), so that the view counts once. `floor`, in 1/(m^2 rad), is added to p. None where p is 0 for all.
    """
    number = len(before.poses)
    first_stage = _likelihood(
        move_poses(before.poses, model.steps, model.sigmas, np.zeros((3, number))), hypothesis, floor
    )
    selection = before.weights * first_stage
    if not selection.sum() > 0.0:
        return None
    chosen = systematic(selection, number, float(rng.random()))
    poses = move_poses(before.poses[chosen], model.steps, model.sigmas, rng.standard_normal((3, number)))
    weights = _likelihood(poses, hypothesis, floor) / first_stage[chosen]
    total = float(weights.sum())
    return Particles(poses, weights / total) if total > 0.0 else None


def _likelihood(poses: Array, hypothesis: GaussianMixture, floor: float) -> Array:
    shares = hypothesis.weights / hypothesis.weights.sum()
    return density(poses, hypothesis.means, hypothesis.covariances, shares) + floor
