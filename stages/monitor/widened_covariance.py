"""Widens the covariance of an estimate to the errors that were measured."""

import math
from dataclasses import field, replace
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage, State
from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.plane.se2 import compose, wrap_angle
from omninav.stages.values.belief import PoseEstimate
from omninav.stages.values.commands import Reinitialise
from omninav.stages.values.confidence import PoseConfidence
from omninav.stages.values.drive import pose_row
from omninav.stages.values.landmarks import LandmarkFix
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import Motion
from omninav.stages.values.track import Track

from .consistency import goes_on

DRIFT_M = (0.1, 0.05)
"""Standard deviation of odometry's position since the last pose by landmarks, m: per root of a metre, and per metre."""
MAX_SQUARES = 16.0
"""Largest squared Mahalanobis distance from the estimate at which a pose by landmarks agrees with it; 99.9 % of
correct poses are within it (chi-square, 3 degrees of freedom)."""
JUMP = (0.5, math.radians(10.0))
"""Distance (m; the map's length scale where that is more) and turn (rad) from where odometry leads the last estimate,
beyond which the next one does not go on from it."""
AGREES = 0.9
"""Smallest probability of a pose by landmarks that agrees with the estimate."""


class WidenCovarianceState(State):
    """Metres driven since landmarks gave the pose that was estimated, and the last estimate (3,)."""

    driven_m: float = math.inf
    estimate: Array = field(default_factory=lambda: np.zeros(3))


class WidenCovariance(Stage):
    """Widens the covariance of a particle filter's mode, which is too sure, to the errors that were measured.

    The filter takes images for independent, and where the robot drives beside the mapped path they agree on an estimate
    that is off by a share of the appearance length scale, which no particle shows. So that share of the map's length
    scale, squared, is added to both variances of the position. While the estimate is more probably wrong than right,
    the robot may be anywhere in the map: the covariance is that of the map's references about the estimate, and of any
    heading. Where landmarks gave the pose, no share is added; from there on, odometry's drift since that pose is, until
    it exceeds the share, the estimate jumps or the robot was carried. The variances of the nearest reference's own pose
    are added always: where odometry measured the map, it is bent, which neither landmarks nor particles show.
    Evaluation and choice of the share: docs/experiments/confidence.md.
    """

    floor: Annotated[float, Bounds(ge=0)] = 0.6
    """Standard deviation of the error that particles do not show, in each direction, in length scales of the map. Its
    square is added to the variances. After a pose from landmarks, the square of odometry's drift (`DRIFT_M`) is added
    instead while it is smaller."""
    min_confidence: Annotated[float, Bounds(ge=0, le=1)] = 0.5
    """Probability of the mode below which the covariance covers the whole map; 0: never."""

    class Out(Outputs):
        estimate: PoseEstimate

    def step(
        self,
        ctx: Context,
        estimate: PoseEstimate,
        confidence: PoseConfidence,
        length_scale: LengthScale,
        map: ReferenceGraph,
        state: WidenCovarianceState,
        fix: LandmarkFix | None = None,
        motion: Motion | None = None,
        restart: Reinitialise | None = None,
        track: Track | None = None,
    ) -> Out:
        before, pose = state.estimate, np.array(pose_row(estimate.pose))
        if math.isfinite(state.driven_m):
            if motion is not None:
                state.driven_m += math.hypot(motion.x, motion.y)
                before = compose(before, np.array((motion.x, motion.y, motion.turn)))
            begins = ctx.tick.first_of_log or restart is not None or (track is not None and track.carried)
            if begins or not goes_on(before, pose, max(JUMP[0], length_scale.metres), JUMP[1]):
                state.driven_m = math.inf
        state.estimate = pose
        if fix is not None and is_the_estimate(fix, estimate):
            state.driven_m = 0.0
        drift = DRIFT_M[0] ** 2 * state.driven_m + (DRIFT_M[1] * state.driven_m) ** 2
        variance = min((self.floor * length_scale.metres) ** 2, drift)
        covariance = estimate.covariance.copy()
        covariance[0, 0] += variance
        covariance[1, 1] += variance
        sigmas = None if map.landmarks is None else map.landmarks.pose_sigmas
        if sigmas is not None and len(sigmas):
            away = map.poses[: len(sigmas), :2] - pose[:2]  # later ones are learned since
            covariance += np.diag(sigmas[np.argmin((away**2).sum(axis=1))] ** 2)
        if confidence.of_mode < self.min_confidence:
            covariance = covariance + map_covariance(pose, map)
        return self.Out(estimate=replace(estimate, covariance=covariance))


def is_the_estimate(fix: LandmarkFix, estimate: PoseEstimate) -> bool:
    """Tests whether an estimate is, within their covariances, a pose that landmarks are sure of."""
    away = fix.poses[0] - np.array(pose_row(estimate.pose))
    away[2] = wrap_angle(float(away[2]))
    squares = away @ np.linalg.solve(fix.covariances[0] + estimate.covariance, away)
    return bool(fix.probabilities[0] >= AGREES and squares <= MAX_SQUARES)


def map_covariance(pose: Array, map: ReferenceGraph) -> Array:
    """The covariance (3, 3) about a pose (3,) of a robot at any reference, with any heading."""
    covariance = np.zeros((3, 3))
    if len(map):
        away = map.poses[:, :2] - pose[:2]
        covariance[:2, :2] = away.T @ away / len(away)
    covariance[2, 2] = math.pi**2 / 3.0
    return covariance
