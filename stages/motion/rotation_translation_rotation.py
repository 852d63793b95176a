"""Moves particles by odometry, and measures how exact that is by poses that landmarks tell on the way."""

import math
from dataclasses import field, replace

import numpy as np

from omninav.pipeline import Context, Outputs, Stage, State
from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.plane.odometry_motion import move_poses
from omninav.stages.geometry.plane.se2 import compose, wrap_angle
from omninav.stages.values.belief import Particles
from omninav.stages.values.landmarks import LandmarkFix
from omninav.stages.values.pose import Motion, UncertainMotion

from .odometry_noise_model import OdometryNoiseModel

SURE = 0.95
"""Probability of a pose by landmarks from which it tells where the robot is."""
STRETCH_M = 0.5
"""Way between two such poses whose odometry is compared with them, at least (m)."""
MAX_STRETCH_M = 5.0
"""The same at most: on a longer one the ends' distance depends on turns."""
PRIOR = 3.0
"""Stretches as which the stated noise counts."""
MEMORY = 100.0
"""Stretches that are remembered: floors and loads change."""
MAX_SQUARE = 16.0
"""Largest square of an error, in variances of the stated noise, that a stretch counts with: a robot that was carried
shows nothing of its wheels."""


class MeasuredNoise(State):
    """Squared errors of odometry in variances of its stated noise, of turns and of lengths: `squares` (2,), summed over
    as many `stretches`. `anchor` (3,): the last sure pose; `since` (3,): odometry from there; `driven`: its way (m);
    `expected` (2,): variances of its turn and length by the stated noise."""

    squares: Array = field(default_factory=lambda: np.full(2, PRIOR))
    stretches: float = PRIOR
    anchor: Array | None = None
    since: Array = field(default_factory=lambda: np.zeros(3))
    expected: Array = field(default_factory=lambda: np.zeros(2))
    driven: float = 0.0

    def start(self, pose: Array | None) -> None:
        """Compare from this pose (3,) on; None: from the next sure one."""
        self.anchor, self.since, self.expected, self.driven = pose, np.zeros(3), np.zeros(2), 0.0

    def move(self, motion: Motion, stated: UncertainMotion) -> None:
        """Drive on by a motion with its stated noise."""
        if type(motion) is not Motion:  # bridged or guessed, so that it shows nothing of odometry
            self.start(None)
            return
        self.since = compose(self.since, np.array([motion.x, motion.y, motion.turn]))
        first, way, second = stated.sigmas
        self.expected += (first**2 + second**2, way**2)
        self.driven += abs(stated.steps[1])

    def compare(self, fix: LandmarkFix) -> None:
        """Compare the odometry up to here with the pose by landmarks, if it is sure."""
        if not len(fix) or fix.probabilities[0] < SURE or (self.anchor is not None and self.driven < STRETCH_M):
            return
        if self.anchor is not None and self.driven < MAX_STRETCH_M:
            away, covariance = fix.poses[0] - self.anchor, fix.covariances[0]
            turn = wrap_angle(float(away[2] - self.since[2]))
            length = math.hypot(away[0], away[1]) - math.hypot(self.since[0], self.since[1])
            seen = 2.0 * np.array([covariance[2, 2], 0.5 * (covariance[0, 0] + covariance[1, 1])])
            errors = np.maximum(np.square((turn, length)) - seen, 0.0)
            squares = np.divide(errors, self.expected, out=np.ones(2), where=self.expected > 0.0)
            kept = 1.0 if self.stretches < MEMORY else 1.0 - 1.0 / MEMORY
            self.squares = kept * self.squares + np.minimum(squares, MAX_SQUARE)
            self.stretches = kept * self.stretches + 1.0
        self.start(fix.poses[0])

    def applied(self, stated: UncertainMotion) -> UncertainMotion:
        """The motion with the noise that was measured in place of the stated one."""
        turn, length = np.sqrt(self.squares / self.stretches).tolist()
        first, way, second = stated.sigmas
        return replace(stated, sigmas=(turn * first, length * way, turn * second))


class RotationTranslationRotation(OdometryNoiseModel, Stage):
    """Samples the odometry motion model: rotation, translation, rotation, each with noise (`OdometryNoiseModel`).

    Without motion (the first image of a log) the belief stays as it is. Stated noise has to do for any robot; where
    poses by landmarks are wired, it is scaled to the errors that these show: between two sure ones odometry is compared
    with both, and the factors are root mean squares of its errors in standard deviations, of turns and of lengths (not
    in the papers; docs/experiments/landmarks.md). Constant errors are not learned: over half a metre chance outweighs
    them.
    """

    class Out(Outputs):
        """The predicted belief; `model`: the motion with its uncertainty."""

        belief: Particles
        model: UncertainMotion | None = None

    def step(
        self,
        ctx: Context,
        belief: Particles,
        motion: Motion | None,
        measured: MeasuredNoise,
        fix: LandmarkFix | None = None,
    ) -> Out:
        """Predict the belief. `fix`: of the image before."""
        if motion is None:
            measured.start(None)
            return self.Out(belief=belief)
        if fix is not None:
            measured.compare(fix)
        model = self.model(motion)
        measured.move(motion, model)
        if type(motion) is Motion:
            model = measured.applied(model)
        noise = ctx.rng.standard_normal((3, len(belief.poses)))
        poses = move_poses(belief.poses, model.steps, model.sigmas, noise)
        return self.Out(belief=Particles(poses, belief.weights, belief.recovery_particles), model=model)
