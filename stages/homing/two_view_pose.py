"""Where a second view was taken, seen from the first."""

import math
from typing import Annotated

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.geometry.two_views.relative_pose_ransac import Solver, relative_pose
from omninav.stages.values.two_views import BearingPairs, RelativeView


class TwoViewPose(Stage):
    """Relative pose of two views from pairs of bearings of which many are wrong, by one of three solvers.

    Goedemé et al. 2007, section 7.1.1: random samples, of which the one counts that most pairs agree with, `refine`d at
    its local optimum where it is so said. `planar`: two pairs in a sample, for a robot on a floor; `five_point`,
    `eight_point` (the paper's). `threshold_deg`, `confidence`, `most`: see `geometry.consensus`.
    """

    solver: Solver = "planar"
    threshold_deg: Annotated[float, Bounds(gt=0)] = 0.5
    confidence: Annotated[float, Bounds(gt=0, lt=1)] = 0.9999
    most: Annotated[int, Bounds(ge=1)] = 5000
    refine: bool = True

    class Out(Outputs):
        """Absent where too few pairs were given, or no sample had a solution."""

        view: RelativeView | None = None

    def step(self, ctx: Context, pairs: BearingPairs) -> Out:
        """Solve one problem."""
        found = relative_pose(
            pairs.first,
            pairs.second,
            ctx.rng,
            self.solver,
            math.radians(self.threshold_deg),
            self.confidence,
            self.most,
            self.refine,
        )
        if found is None:
            ctx.count("no_relative_pose")
            return self.Out()
        return self.Out(view=RelativeView(found.rotation, found.translation, found.inliers, found.samples))
