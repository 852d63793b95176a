"""Known poses as one more hypothesis."""

import math
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage, State
from omninav.stages.values.belief import GaussianMixture
from omninav.stages.values.pose import Pose


class PoseFixesState(State):
    """Metres driven since the last fix and since the log began, and the last position (x, y)."""

    since_fix_m: float = math.inf
    driven_m: float = 0.0
    position: tuple[float, float] | None = None


class PoseFixes(Stage):
    """Gives the robot's true pose at times, as a Gaussian, as a person who corrects its position would.

    "While building the map for the first time, supplementary localization information could be given to achieve a
    higher initial precision" (Gross, Koenig & Mueller 2005, section 3). It is one more hypothesis for the fusion, and
    the only way for ground truth into a map that is learned during its use. Absent, and counted, where the log has no
    true pose.
    """

    every_m: Annotated[float, Bounds(ge=0)] = 0.0
    """Distance driven between two fixes; 0: at each image. A log's first image has one."""
    places: tuple[tuple[float, float], ...] = ()
    """Only near these positions, [[x, y], ...] in m; empty: anywhere."""
    radius_m: Annotated[float, Bounds(gt=0)] = 0.5
    """Distance from one of `places` that counts as near."""
    logs: tuple[int, ...] = ()
    """Only in these logs, counted from 0; empty: in all."""
    first_m: Annotated[float, Bounds(ge=0)] = 0.0
    """Only on the first metres of a log; 0: on all."""
    sigma_m: Annotated[float, Bounds(gt=0)] = 0.05
    """Standard deviation of the fix's position."""
    sigma_rad: Annotated[float, Bounds(gt=0)] = 0.02
    """Standard deviation of its heading."""
    weight: Annotated[float, Bounds(gt=0)] = 1.0
    """Weight against the other sources, whose weights sum to about 1."""

    class Out(Outputs):
        """One Gaussian at the true pose; absent between fixes."""

        hypothesis: GaussianMixture | None = None

    def step(self, ctx: Context, truth: Pose | None, state: PoseFixesState) -> Out:
        """Give a fix where one is due."""
        if ctx.tick.first_of_log:
            state.since_fix_m, state.driven_m, state.position = math.inf, 0.0, None
        if self.logs and ctx.tick.log not in self.logs:
            return self.Out()
        if truth is None:
            ctx.count("image_without_true_pose", detail="pose_fixes: this image has no true pose")
            return self.Out()
        if state.position is not None:
            moved = math.hypot(truth.x - state.position[0], truth.y - state.position[1])
            state.since_fix_m, state.driven_m = state.since_fix_m + moved, state.driven_m + moved
        state.position = (truth.x, truth.y)
        over = self.first_m > 0.0 and state.driven_m > self.first_m
        gaps = [math.hypot(truth.x - x, truth.y - y) for x, y in self.places]
        if over or state.since_fix_m < self.every_m or min(gaps, default=0.0) > self.radius_m:
            return self.Out()
        state.since_fix_m = 0.0
        sigmas = np.array([self.sigma_m, self.sigma_m, self.sigma_rad])
        mean = np.array([[truth.x, truth.y, truth.heading]])
        return self.Out(hypothesis=GaussianMixture(mean, np.diag(sigmas**2)[None], np.array([self.weight])))
