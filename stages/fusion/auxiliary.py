"""The auxiliary particle filter: whom to move is decided by how well the move would fit."""

import numpy as np
import numpy.typing as npt

from omninav.stages.geometry.plane.odometry_motion import moved
from omninav.stages.geometry.probability.gaussians import density
from omninav.stages.geometry.probability.particles import systematic
from omninav.stages.values.belief import GaussianMixture, Particles
from omninav.stages.values.pose import UncertainMotion

Array = npt.NDArray[np.float64]


def auxiliary(
    before: Particles, model: UncertainMotion, hypothesis: GaussianMixture, floor: float, rng: np.random.Generator
) -> Particles | None:
    """Particles after a motion and a view, by the auxiliary filter of Pitt & Shephard 1999 (erratum 15).

    `before`: the belief before the motion. First stage: each particle is chosen by pi_i p(y|mu_i), mu_i where the
    motion without its noise leads it. The chosen move with noise. Second stage: they weigh p(y|x) / p(y|mu), so that
    the view counts once. `floor`, in 1/(m^2 rad), is added to p. None where no first choice fits the view at all.
    """
    number = len(before.poses)
    likely = _likelihood(moved(before.poses, model.way, (0.0, 0.0, 0.0), np.zeros((3, number))), hypothesis, floor)
    first = before.weights * likely
    if not first.sum() > 0.0:
        return None
    chosen = systematic(first, number, float(rng.random()))
    poses = moved(before.poses[chosen], model.way, model.sigmas, rng.standard_normal((3, number)))
    weights = _likelihood(poses, hypothesis, floor) / likely[chosen]
    total = float(weights.sum())
    return Particles(poses, weights / total) if total > 0.0 else None


def _likelihood(poses: Array, hypothesis: GaussianMixture, floor: float) -> Array:
    shares = hypothesis.weights / hypothesis.weights.sum()
    return density(poses, hypothesis.means, hypothesis.covariances, shares) + floor
