"""Takes poses from landmarks into a belief of particles."""

import math
from dataclasses import field
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage, State
from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.plane.se2 import compose, wrap
from omninav.stages.geometry.probability.evidence import evidence_novelty
from omninav.stages.geometry.probability.gaussians import intersected
from omninav.stages.geometry.probability.particles import (
    are_within,
    is_narrow,
    share_within,
    systematic,
    weighted_moments,
)
from omninav.stages.values.belief import Particles
from omninav.stages.values.commands import Reinitialise
from omninav.stages.values.landmarks import LandmarkFix
from omninav.stages.values.length_scale import LengthScale, metres_of
from omninav.stages.values.pose import Motion
from omninav.stages.values.track import Track

from .covariance_intersection import alpha_of_min_determinant

LOCAL = (1.0, math.radians(30.0))
"""Distance (m) and turn (rad) from a pose within which the belief is taken for one Gaussian."""
PLACES_ALIKE = 20.0
"""Places among which a wrong pose falls: not anywhere, but where the map looks like the image, and where the belief has
its doubts too."""
OUTLIER_SHARE = 1e-3
"""Probability that a pose of sure landmarks is wrong all the same: they may be elsewhere today."""
MIN_PROPOSED = 0.5
"""Probability of a pose from which on it proposes a place where the belief is not: beside the mapped way, where no pose
is right, one in six images has one that is metres off."""
CARRIED, MIN_PROPOSED_CARRIED = 0.5, 0.1
"""Probability that a robot that was surely carried, or started anywhere, is elsewhere; and `MIN_PROPOSED` until it is
found there."""
INDEPENDENT = 4.0
"""Distance driven, in length scales, after which a pose against the belief is new evidence: until then images show the
same things, and in a store's unmapped aisle twelve in a row over 2.6 m agreed on one wrong place."""


class LandmarkUpdateState(State):
    """The poses (K, 3) of the last fix, carried to where the robot is now, and the way driven since (m).

    `elsewhere`: probability that it was carried to where no pose has been proposed since.
    """

    poses: Array = field(default_factory=lambda: np.empty((0, 3)))
    driven: float = 0.0
    elsewhere: float = 0.0


class LandmarkUpdate(Stage):
    """Updates a belief by the poses from which an image may have been taken.

    The likelihood is a mixture: each Gaussian of the fix is right with its probability; otherwise the image says
    nothing, and the belief stays. Around each Gaussian the belief is approximated by a Gaussian, and particles are
    drawn from the fusion of both, since particles decimetres apart cannot represent millimetres. The fused mean is that
    of a Kalman update. The fused covariance is that of covariance intersection, since consecutive images share the
    errors of the same landmarks, and a stationary robot gains no information. With `kidnapping_probability` the
    robot may be anywhere, so that a fix where the belief is not draws particles too, if it is rather right than wrong;
    they are its recovery particles until further images agree.
    Where a log begins with a belief that may be anywhere, or once `track` reports that the robot was carried, it is
    elsewhere with probability 0.5. Each fix multiplies this by one minus the total probability of the poses that it
    proposes. So a first pose of probability 0.1 takes half of the belief, which cannot hold all other places; the
    confidence tells how sure the robot is.
    What leads one image to a wrong place leads the next one there too, so that against the belief a fix counts by its
    novelty where it repeats the last one. Without a fix the belief stays as it is.
    """

    particles: Annotated[int, Bounds(ge=10)] = 200
    """Particles that each Gaussian is drawn as."""
    kidnapping_probability: Annotated[float, Bounds(gt=0, lt=1)] = 1e-3
    """Probability at each image that the robot was carried elsewhere."""

    class Out(Outputs):
        belief: Particles

    def step(
        self,
        ctx: Context,
        last: LandmarkUpdateState,
        belief: Particles,
        fix: LandmarkFix | None = None,
        motion: Motion | None = None,
        length_scale: LengthScale | None = None,
        restart: Reinitialise | None = None,
        track: Track | None = None,
    ) -> Out:
        if motion is None or ctx.tick.first_of_log or restart is not None:
            last.poses, last.driven, last.elsewhere = np.empty((0, 3)), 0.0, 0.0
            if (ctx.tick.first_of_log or restart is not None) and not is_narrow(belief.poses, belief.weights, LOCAL[0]):
                last.elsewhere = CARRIED
        else:
            last.poses = compose(last.poses, np.array([motion.x, motion.y, motion.turn]))
            last.driven += math.hypot(motion.x, motion.y)
        if track is not None and track.carried:
            last.poses, last.elsewhere = np.empty((0, 3)), CARRIED
        if fix is None or not len(fix):
            return self.Out(belief=belief)
        elsewhere = max(last.elsewhere, self.kidnapping_probability)
        least = MIN_PROPOSED if elsewhere == self.kidnapping_probability else MIN_PROPOSED_CARRIED
        proposed = fix.probabilities[fix.probabilities >= least]
        last.elsewhere *= 1.0 - min(float(proposed.sum()), 1.0)
        novelty = self._novelty(last, belief, fix.poses[0], metres_of(length_scale))
        last.poses, last.driven = fix.poses, 0.0
        sure = np.minimum(fix.probabilities, 1.0 - OUTLIER_SHARE)
        unsaid = (1.0 - min(float(sure.sum()), 1.0 - OUTLIER_SHARE)) / PLACES_ALIKE
        old = belief.weights * unsaid**novelty
        poses, weights, recovery, free = [belief.poses], [old], [], np.ones(len(belief.poses), np.bool_)
        for mean, covariance, probability in zip(fix.poses, fix.covariances, sure.tolist(), strict=True):
            local = are_within(np.ascontiguousarray(belief.poses), mean, *LOCAL) & free
            free &= ~local  # where two poses are close together, a particle counts for the better one
            share = float(np.add.reduce(belief.weights[local]))
            if share > 0.0:
                local_mean, spread = weighted_moments(belief.poses[local], belief.weights[local])
                away = local_mean - mean
                away[2] = wrap(away[2])
                both = spread + covariance
                agreement = probability * math.exp(-0.5 * float(away @ np.linalg.solve(both, away)))
                spread = spread + np.diag([1e-12] * 3)
                alpha = alpha_of_min_determinant(spread, covariance)
                centre = mean + covariance @ np.linalg.solve(both, away)
                _, product = intersected(local_mean, spread, mean, covariance, alpha)
                # The factor of this place, of belief and fix together, is raised to the novelty; both keep their ratio.
                counted = (unsaid + agreement) ** (novelty - 1.0)
                old[local] = belief.weights[local] * unsaid * counted
                poses.append(self._drawn(ctx, centre, product))
                weights.append(np.full(self.particles, share * agreement * counted / self.particles))
            if probability < least:
                continue
            new = elsewhere * novelty * probability**novelty
            recovery.append((self._drawn(ctx, mean, covariance), np.full(self.particles, new / self.particles)))
        return self.Out(belief=self._resampled(ctx, poses, weights, recovery))

    def _novelty(self, last: LandmarkUpdateState, belief: Particles, pose: Array, unit: float) -> float:
        believed = share_within(belief.poses, belief.weights, pose, *LOCAL)
        if believed > 0.5 or not len(last.poses) or not are_within(last.poses, pose, *LOCAL).any():
            return 1.0
        return evidence_novelty(last.driven, INDEPENDENT * unit)

    def _drawn(self, ctx: Context, mean: Array, covariance: Array) -> Array:
        root = np.linalg.cholesky(0.5 * (covariance + covariance.T) + np.diag([1e-12] * 3))
        normal = ctx.rng.standard_normal((self.particles, 3))
        normal -= normal.mean(axis=0)
        # Chance in the particles' covariance would shrink that of a stationary robot, image by image.
        normal = np.linalg.solve(np.linalg.cholesky(normal.T @ normal / self.particles), normal.T).T
        poses = mean + normal @ root.T
        poses[:, 2] = wrap(poses[:, 2])
        return poses

    def _resampled(
        self, ctx: Context, poses: list[Array], weights: list[Array], recovery: list[tuple[Array, Array]]
    ) -> Particles:
        # The old belief keeps as many particles as it deserves; a few represent what landmarks contradict. Its recovery
        # particles are not kept apart: in dim light colours are wrong, and lost 152 images of 556 in place of 36.
        total = sum(float(np.add.reduce(each)) for each in weights) + sum(float(np.add.reduce(w)) for _, w in recovery)
        old = float(np.add.reduce(weights[0])) / total
        kept = min(len(poses[0]), max(self.particles // 4, math.ceil(old * len(poses[0]))))
        rows = systematic(weights[0], kept, float(ctx.rng.random()))
        parts = [poses[0][rows], *poses[1:], *(p for p, _ in recovery)]
        shares = [np.full(kept, old / kept), *(w / total for w in weights[1:]), *(w / total for _, w in recovery)]
        number = sum(len(p) for p, _ in recovery)
        return Particles(np.concatenate(parts), np.concatenate(shares) / sum(s.sum() for s in shares), number)
