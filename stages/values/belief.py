"""Beliefs about the robot's pose. Every belief answers `estimate()`."""

import math
from abc import abstractmethod
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Covariances, Shape, Shares, Value
from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.probability.particles import mode_and_mean, weighted_mean

from .pose import Pose

MODE_RADIUS = (1.0, math.radians(30.0))
"""Radius of a mode of particles, m and rad: those within it of the mode's mean belong to it."""


class PoseEstimate(Value):
    """A pose to act upon: the belief's heaviest mode, with the whole belief's mean beside it.

    `covariance` (3, 3) is the mode's, or what `WidenCovariance` made of it, over (x, y, heading) in m, m, rad;
    `mode_weight` is its share of the belief in [0, 1]; `mean` is the mean pose of the whole belief (circular in
    heading). `place`: which place of a topological map that mode is; None where the map has no places.
    """

    pose: Pose
    covariance: Annotated[Array, Shape(3, 3)]
    mode_weight: Annotated[float, Bounds(ge=0, le=1 + 1e-6)]
    mean: Pose
    place: int | None = None


class Belief(Value):
    """A belief about the robot's pose."""

    @abstractmethod
    def estimate(self, radius: tuple[float, float] = MODE_RADIUS) -> PoseEstimate:
        """The heaviest mode as one pose; of particles with this radius (m, rad)."""


class Particles(Belief):
    """Weighted samples of the pose. `poses`: (N, 3) x, y (m), heading (rad), map frame. `weights`: (N,), sum 1.

    The last `recovery_particles` of them are hypotheses of a kidnapped robot: images keep them, however small their
    weights, until enough evidence for them has accumulated.
    """

    poses: Annotated[Array, Shape("N", 3)]
    weights: Annotated[Array, Shape("N"), Shares()]
    recovery_particles: Annotated[int, Bounds(ge=0)] = 0

    def estimate(self, radius: tuple[float, float] = MODE_RADIUS) -> PoseEstimate:
        mode, covariance, share, mean = mode_and_mean(self.poses, self.weights, *radius)
        return PoseEstimate(Pose(*mode.tolist()), covariance, share, Pose(*mean.tolist()))


class GaussianMixture(Belief):
    """Weighted Gaussians over the pose. `means`: (K, 3) x, y (m), heading (rad), map frame. `covariances`: (K, 3, 3)
    in m, m, rad. `weights`: (K,), not negative; a belief's sum to 1, a hypothesis's need not. K may be 0.
    """

    means: Annotated[Array, Shape("K", 3)]
    covariances: Annotated[Array, Shape("K", 3, 3), Covariances()]
    weights: Annotated[Array, Shape("K"), Bounds(ge=0)]

    def __len__(self) -> int:
        return len(self.weights)

    def estimate(self, radius: tuple[float, float] = MODE_RADIUS) -> PoseEstimate:
        """The heaviest component. Raises ValueError where there is none."""
        heaviest = int(np.argmax(self.weights))
        mean = weighted_mean(self.means, self.weights)
        share = float(self.weights[heaviest] / self.weights.sum())
        pose = Pose(*map(float, self.means[heaviest]))
        return PoseEstimate(pose, self.covariances[heaviest], share, Pose(*map(float, mean)))


class SinglePose(Belief):
    """A belief that is one pose without uncertainty (nearest-image matching)."""

    pose: Pose

    def estimate(self, radius: tuple[float, float] = MODE_RADIUS) -> PoseEstimate:
        return PoseEstimate(self.pose, np.zeros((3, 3)), 1.0, self.pose)


class PlaceBelief(Belief):
    """Which place of a topological map the robot is at. `probabilities`: (P,), sum 1.

    `poses` (P, 3): x, y (m), heading (rad) of the robot if it was where each place's medoid was taken; the heading
    includes the turn between the two views. Places have no size in metres: the covariance is zero.
    """

    probabilities: Annotated[Array, Shape("P"), Shares()]
    poses: Annotated[Array, Shape("P", 3)]

    def estimate(self, radius: tuple[float, float] = MODE_RADIUS) -> PoseEstimate:
        place = int(np.argmax(self.probabilities))
        mean = weighted_mean(self.poses, self.probabilities)
        pose = Pose(*map(float, self.poses[place]))
        share = float(self.probabilities[place])
        return PoseEstimate(pose, np.zeros((3, 3)), share, Pose(*map(float, mean)), place)


class Likelihood(Value):
    """Likelihood of the present view for each particle, or each place. `values`: (N,), not negative, any scale.

    `mean_likelihood`: on the same scale, the mean over all poses of the map: what a pose drawn uniformly would get.
    None where it is not known. `novelty`: the share of the image's evidence that is new, in [0, 1]; below 1 where the
    robot has hardly moved since the previous image. `carried`: probability that the robot was carried since
    then, as the image does not look like the last.
    """

    values: Annotated[Array, Shape("N"), Bounds(ge=0)]
    mean_likelihood: Annotated[float | None, Bounds(ge=0)] = None
    novelty: Annotated[float, Bounds(ge=0, le=1)] = 1.0
    carried: Annotated[float, Bounds(ge=0, lt=1)] = 0.0
