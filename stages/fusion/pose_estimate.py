"""The pose that a belief stands for."""

from dataclasses import replace
from typing import Literal

from omninav.pipeline import Context, Outputs, Stage
from omninav.stages.values.belief import Belief, PoseEstimate


class BeliefEstimate(Stage):
    """Gives the belief's heaviest mode as one pose, with the mean of the whole belief beside it.

    A split belief's mean lies where the robot is not, so the mode is what is measured and acted upon. Map frame,
    metres, radians.
    """

    taken: Literal["mode", "mean"] = "mode"
    """The pose that is measured and acted upon: the heaviest `mode`, or the `mean` of the whole belief, as in Wolf,
    Burgard & Burkhardt 2005, section VI-B (erratum 47 in docs/papers.md). Covariance and share are the mode's."""

    class Out(Outputs):
        """`estimate`: mode, covariance, share of the belief, mean."""

        estimate: PoseEstimate

    def step(self, ctx: Context, belief: Belief) -> Out:
        """One belief, one estimate."""
        estimate = belief.estimate()
        return self.Out(estimate=replace(estimate, pose=estimate.mean) if self.taken == "mean" else estimate)
