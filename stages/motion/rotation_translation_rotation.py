"""Moves particles by odometry."""

from omninav.pipeline import Context, Outputs, Stage
from omninav.stages.geometry.plane.odometry_motion import move_poses
from omninav.stages.values.belief import Particles
from omninav.stages.values.pose import Motion, UncertainMotion

from .odometry_noise import OdometryNoiseModel


class RotationTranslationRotation(OdometryNoiseModel, Stage):
    """Samples the odometry motion model: rotation, translation, rotation, each with noise (`OdometryNoiseModel`).

    Without motion (the first image of a log) the belief stays as it is.
    """

    class Out(Outputs):
        """The predicted belief; `model`: the motion with its uncertainty."""

        belief: Particles
        model: UncertainMotion | None = None

    def step(self, ctx: Context, belief: Particles, motion: Motion | None) -> Out:
        """Predict the belief."""
        if motion is None:
            return self.Out(belief=belief)
        model = self.model(motion)
        noise = ctx.rng.standard_normal((3, len(belief.poses)))
        poses = move_poses(belief.poses, model.steps, model.sigmas, noise)
        return self.Out(belief=Particles(poses, belief.weights, belief.recovery_particles), model=model)
