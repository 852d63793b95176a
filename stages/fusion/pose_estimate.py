"""The pose that represents a belief."""

import math
from dataclasses import replace
from typing import Annotated, Literal

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.values.belief import MODE_RADIUS, Belief, PoseEstimate
from omninav.stages.values.length_scale import LengthScale, metres_of


class BeliefEstimate(Stage):
    """Gives the belief's heaviest mode as one pose, with the mean of the whole belief beside it.

    A split belief's mean is where the robot is not, so the mode is what is measured and acted upon. Map frame,
    metres, radians.
    """

    taken: Literal["mode", "mean"] = "mode"
    """The pose that is measured and acted upon: the heaviest `mode`, or the `mean` of the whole belief, as in Wolf,
    Burgard & Burkhardt 2005, section VI-B (erratum 47 in docs/papers.md). Covariance and share are the mode's."""
    mode_radius: Annotated[float, Bounds(gt=0)] | None = None
    """Radius of a mode of particles, in length scales of the map; null: 1 m. With 2 the median error on AntWorld, whose
    length scale is 0.06 m, is 4.6 cm in place of 6.0; in a house and on Sussex it is the same (`omninav`, seed 0)."""
    mode_radius_deg: Annotated[float, Bounds(gt=0, le=90)] = 30.0
    """The same in heading."""

    class Out(Outputs):
        """`estimate`: mode, covariance, share of the belief, mean."""

        estimate: PoseEstimate

    def step(self, ctx: Context, belief: Belief, length_scale: LengthScale | None = None) -> Out:
        """One belief, one estimate."""
        metres = MODE_RADIUS[0] if self.mode_radius is None else self.mode_radius * metres_of(length_scale)
        estimate = belief.estimate((metres, math.radians(self.mode_radius_deg)))
        return self.Out(estimate=replace(estimate, pose=estimate.mean) if self.taken == "mean" else estimate)
