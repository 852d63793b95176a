"""Moves particles by odometry: turn, go, turn, each with its own noise."""

from omninav.pipeline import Context, Outputs, Stage
from omninav.stages.geometry.plane.odometry_motion import moved
from omninav.stages.values.belief import Particles
from omninav.stages.values.pose import Motion, UncertainMotion

from .odometry_noise import OdometryNoise


class RotationTranslationRotation(OdometryNoise, Stage):
    """Samples the motion model: turn, go, turn, with noise that grows with the way and with the turn.

    The noise is `OdometryNoise`'s. Without motion (the first picture of a log) the belief stays as it is.
    """

    class Out(Outputs):
        """The belief after the motion, before the picture is looked at; `model`: the motion and how uncertain it is."""

        belief: Particles
        model: UncertainMotion | None = None

    def step(self, ctx: Context, belief: Particles, motion: Motion | None) -> Out:
        """Move all particles."""
        if motion is None:
            return self.Out(belief=belief)
        model = self.model(motion)
        noise = ctx.rng.standard_normal((3, len(belief.poses)))
        poses = moved(belief.poses, model.way, model.sigmas, noise)
        return self.Out(belief=Particles(poses, belief.weights, belief.aside), model=model)
