"""Poses that are known, or that another estimator gives, as one more hypothesis."""

import math
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage, State
from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.values.belief import GaussianMixture
from omninav.stages.values.pose import Pose

WRONG_M = 8.0
"""Distance of a wrong fix from the truth, metres."""


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

    With `wrong` it simulates an external estimator: "state hypotheses from other sources of information" (sections 1
    and 2.1). Errors are drawn from the Gaussian around the true pose; a wrong fix is `WRONG_M` away from it in any
    direction, and claims to be as exact as the others.
    """

    every_m: Annotated[float, Bounds(ge=0)] = 0.0
    """Distance driven between two fixes; 0: at each image. A log's first image has one."""
    first_m: Annotated[float, Bounds(ge=0)] = 0.0
    """Only on the first metres of a log; 0: on all."""
    sigma_m: Annotated[float, Bounds(gt=0)] = 0.05
    """Standard deviation of the fix's position."""
    sigma_rad: Annotated[float, Bounds(gt=0)] = 0.02
    """Standard deviation of its heading."""
    weight: Annotated[float, Bounds(gt=0)] = 1.0
    """Weight against the other sources, whose weights sum to about 1."""
    wrong: Annotated[float, Bounds(ge=0, le=1)] | None = None
    """Share of the fixes of an external estimator that are wrong; null: they are true poses."""

    class Out(Outputs):
        """`hypothesis`: one Gaussian, absent between fixes; `wrong`: the same where it is wrong."""

        hypothesis: GaussianMixture | None = None
        wrong: GaussianMixture | None = None

    def step(self, ctx: Context, truth: Pose | None, state: PoseFixesState) -> Out:
        """Give a fix where one is due."""
        if ctx.tick.first_of_log:
            state.since_fix_m, state.driven_m, state.position = math.inf, 0.0, None
        if truth is None:
            ctx.count("image_without_true_pose", detail="pose_fixes: this image has no true pose")
            return self.Out()
        if state.position is not None:
            moved = math.hypot(truth.x - state.position[0], truth.y - state.position[1])
            state.since_fix_m, state.driven_m = state.since_fix_m + moved, state.driven_m + moved
        state.position = (truth.x, truth.y)
        over = self.first_m > 0.0 and state.driven_m > self.first_m
        if over or state.since_fix_m < self.every_m:
            return self.Out()
        state.since_fix_m = 0.0
        sigmas = np.array([self.sigma_m, self.sigma_m, self.sigma_rad])
        mean, is_wrong = np.array([truth.x, truth.y, truth.heading]), False
        if self.wrong is not None:
            mean += sigmas * ctx.rng.standard_normal(3)
            is_wrong, direction = ctx.rng.random() < self.wrong, 2.0 * math.pi * ctx.rng.random()
            if is_wrong:
                mean[:2] += WRONG_M * np.array([math.cos(direction), math.sin(direction)])
            mean[2] = wrap(mean[2])
        fix = GaussianMixture(mean[None], np.diag(sigmas**2)[None], np.array([self.weight]))
        return self.Out(hypothesis=fix, wrong=fix if is_wrong else None)
