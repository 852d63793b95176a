"""Moves particles by odometry."""

from omninav.pipeline import Context, Outputs, Stage
from omninav.stages.geometry.plane.odometry_motion import move_poses
from omninav.stages.values.belief import Particles
from omninav.stages.values.landmarks import LandmarkFix
from omninav.stages.values.pose import Motion, UncertainMotion

from .measured_noise import MeasuredNoise
from .odometry_noise_model import OdometryNoiseModel


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
        elif fix is not None:
            measured.compare(fix)
        if motion is None:
            return self.Out(belief=belief)
        model = self.model(motion)
        measured.move(motion, model)
        if type(motion) is Motion:
            model = measured.applied(model)
        noise = ctx.rng.standard_normal((3, len(belief.poses)))
        poses = move_poses(belief.poses, model.steps, model.sigmas, noise)
        return self.Out(belief=Particles(poses, belief.weights, belief.recovery_particles), model=model)
