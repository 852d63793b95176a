"""Takes poses from landmarks into a belief of particles."""

import math
from typing import Annotated

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.geometry.probability.particles import are_within, systematic, weighted_moments
from omninav.stages.values.belief import Particles
from omninav.stages.values.landmarks import LandmarkFix

Array = npt.NDArray[np.float64]

LOCAL = (1.0, math.radians(30.0))
"""Distance (m) and turn (rad) from a pose within which the belief is taken for one Gaussian."""
PLACES_ALIKE = 20.0
"""Places among which a wrong pose falls: not anywhere, but where the map looks like the image, and where the belief has
its doubts too."""
OUTLIER_SHARE = 1e-3
"""Probability that a pose of sure landmarks is wrong all the same: they may stand elsewhere today."""


class LandmarkUpdate(Stage):
    """Updates a belief by the poses from which an image may have been taken.

    Each Gaussian of the fix is right with its probability, and then the belief's mass around it counts as far as both
    agree; with the rest the image says nothing, and the belief stays. Around each Gaussian the belief is one too, so
    that the product is one (a Kalman update), from which particles are drawn: a particle filter alone, with particles
    decimetres apart, could not take in millimetres. With `kidnapping_probability` the robot may be anywhere, so that a
    fix where the belief is not draws particles too; they are its recovery particles until further images agree.
    Without a fix the belief stays as it is.
    """

    particles: Annotated[int, Bounds(ge=10)] = 200
    """Particles that each Gaussian is drawn as."""
    kidnapping_probability: Annotated[float, Bounds(gt=0, lt=1)] = 1e-3
    """Probability at each image that the robot was carried elsewhere."""

    class Out(Outputs):
        """The belief after the landmarks."""

        belief: Particles

    def step(self, ctx: Context, belief: Particles, fix: LandmarkFix | None = None) -> Out:
        """Fuse belief and fix."""
        if fix is None or not len(fix):
            return self.Out(belief=belief)
        sure = np.minimum(fix.probabilities, 1.0 - OUTLIER_SHARE)
        doubt = 1.0 - min(float(sure.sum()), 1.0 - OUTLIER_SHARE)
        poses, weights, recovery = [belief.poses], [belief.weights * doubt / PLACES_ALIKE], []
        for mean, covariance, probability in zip(fix.poses, fix.covariances, sure.tolist(), strict=True):
            near = are_within(np.ascontiguousarray(belief.poses), mean, *LOCAL)
            share = float(np.add.reduce(belief.weights[near]))
            if share > 0.0:
                there, spread = weighted_moments(belief.poses[near], belief.weights[near])
                away = there - mean
                away[2] = wrap(away[2])
                both = spread + covariance
                evidence = share * probability * math.exp(-0.5 * float(away @ np.linalg.solve(both, away)))
                gain = covariance @ np.linalg.inv(both)
                centre, product = mean + gain @ away, covariance - gain @ covariance
                poses.append(self._drawn(ctx, centre, product))
                weights.append(np.full(self.particles, evidence / self.particles))
            new = self.kidnapping_probability * probability
            recovery.append((self._drawn(ctx, mean, covariance), np.full(self.particles, new / self.particles)))
        return self.Out(belief=self._resampled(ctx, poses, weights, recovery))

    def _drawn(self, ctx: Context, mean: Array, covariance: Array) -> Array:
        root = np.linalg.cholesky(0.5 * (covariance + covariance.T) + np.diag([1e-12] * 3))
        poses = mean + ctx.rng.standard_normal((self.particles, 3)) @ root.T
        poses[:, 2] = wrap(poses[:, 2])
        return poses

    def _resampled(
        self, ctx: Context, poses: list[Array], weights: list[Array], recovery: list[tuple[Array, Array]]
    ) -> Particles:
        # The old belief keeps as many particles as it deserves; a few stand for what landmarks contradict.
        total = sum(float(np.add.reduce(each)) for each in weights) + sum(float(np.add.reduce(w)) for _, w in recovery)
        old = float(np.add.reduce(weights[0])) / total
        kept = min(len(poses[0]), max(self.particles // 4, math.ceil(old * len(poses[0]))))
        rows = systematic(weights[0], kept, float(ctx.rng.random()))
        parts = [poses[0][rows], *poses[1:], *(p for p, _ in recovery)]
        shares = [np.full(kept, old / kept), *(w / total for w in weights[1:]), *(w / total for _, w in recovery)]
        number = sum(len(p) for p, _ in recovery)
        return Particles(np.concatenate(parts), np.concatenate(shares) / sum(s.sum() for s in shares), number)
