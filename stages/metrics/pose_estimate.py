"""The pose that a belief stands for."""

from omninav.pipeline import Context, Outputs, Stage
from omninav.stages.values.belief import Belief, PoseEstimate


class BeliefEstimate(Stage):
    """The belief's heaviest mode as one pose, with the mean of the whole belief beside it.

    A split belief's mean lies where the robot is not, so the mode is what is measured and acted upon. Map frame,
    metres, radians.
    """

    class Out(Outputs):
        """`estimate`: mode, covariance, share of the belief, mean."""

        estimate: PoseEstimate

    def step(self, ctx: Context, belief: Belief) -> Out:
        """One belief, one estimate."""
        return self.Out(estimate=belief.estimate())
