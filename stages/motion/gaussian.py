"""Moves a mixture of Gaussians by odometry."""

from omninav.pipeline import Context, Outputs, Stage
from omninav.stages.geometry.plane.odometry_motion import move_gaussians
from omninav.stages.values.belief import GaussianMixture
from omninav.stages.values.pose import Motion, UncertainMotion

from .odometry_noise_model import OdometryNoiseModel


class GaussianMotion(OdometryNoiseModel, Stage):
    """Moves each Gaussian of a mixture by rotation, translation, rotation, linearised around its mean.

    The prediction of Gross, Koenig & Mueller 2005, section 2; the paper does not print the model. Weights stay. Without
    motion (the first image of a log) the belief stays as it is.
    """

    class Out(Outputs):
        """The predicted belief; `model`: the motion with its uncertainty."""

        belief: GaussianMixture
        model: UncertainMotion | None = None

    def step(self, ctx: Context, belief: GaussianMixture, motion: Motion | None) -> Out:
        if motion is None:
            return self.Out(belief=belief)
        model = self.model(motion)
        means, covariances = move_gaussians(belief.means, belief.covariances, model.steps, model.sigmas)
        return self.Out(belief=GaussianMixture(means, covariances, belief.weights), model=model)
