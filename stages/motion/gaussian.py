"""Moves a mixture of Gaussians by odometry: turn, go, turn, each with its own noise."""

from omninav.pipeline import Context, Outputs, Stage
from omninav.stages.geometry.plane.odometry_motion import moved_gaussians
from omninav.stages.values.belief import GaussianMixture
from omninav.stages.values.pose import Motion, UncertainMotion

from .odometry_noise import OdometryNoise


class GaussianMotion(OdometryNoise, Stage):
    """Moves each Gaussian of a mixture by turn, go, turn, linearised around its mean.

    What the motion model makes of the last state hypothesis (Gross, Koenig & Mueller 2005, section 2; the paper does
    not print the model). The noise is `OdometryNoise`'s, the same as the sampler's. Weights stay. Without motion (the
    first picture of a log) the belief stays as it is.
    """

    class Out(Outputs):
        """The belief after the motion, before the picture is looked at; `model`: the motion and how uncertain it is."""

        belief: GaussianMixture
        model: UncertainMotion | None = None

    def step(self, ctx: Context, belief: GaussianMixture, motion: Motion | None) -> Out:
        """Move all Gaussians."""
        if motion is None:
            return self.Out(belief=belief)
        model = self.model(motion)
        means, covariances = moved_gaussians(belief.means, belief.covariances, model.way, model.sigmas)
        return self.Out(belief=GaussianMixture(means, covariances, belief.weights), model=model)
