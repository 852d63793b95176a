"""Relative pose of a second view, seen from the first."""

import math
from typing import Literal

from omninav.pipeline import Context, Outputs, Stage
from omninav.stages.geometry.two_views.relative_pose_ransac import Solver, relative_pose
from omninav.stages.values.two_views import BearingPairs, RelativeView

from .generate_and_select import generate_and_select

MAX_ERROR_DEG = 0.5
"""Largest angle by which the two bearings of a pair may together miss the pose, degrees."""


class TwoViewPose(Stage):
    """Relative pose of two views from pairs of bearings of which many are wrong, by one of four solvers.

    Goedemé et al. 2007, section 7.1.1: of random samples the one counts with which most pairs agree; or Svoboda's
    algorithm, which they could not use.
    """

    solver: Solver | Literal["generate_and_select"] = "planar"
    """`planar`: two pairs in a sample, for a robot on a floor; `five_point`; `eight_point`, the paper's;
    `generate_and_select`, which draws no samples and refines nothing."""
    refine: bool = True
    """Whether the best sample's pose is brought to its local optimum."""

    class Out(Outputs):
        """Absent where too few pairs were given, or no sample had a solution."""

        view: RelativeView | None = None

    def step(self, ctx: Context, pairs: BearingPairs) -> Out:
        threshold = math.radians(MAX_ERROR_DEG)
        if self.solver == "generate_and_select":
            found = generate_and_select(pairs.first, pairs.second, threshold)
        else:
            found = relative_pose(pairs.first, pairs.second, ctx.rng, self.solver, threshold, refine=self.refine)
        if found is None:
            ctx.count("no_relative_pose")
            return self.Out()
        return self.Out(view=RelativeView(found.rotation, found.translation, found.inliers, found.samples))
