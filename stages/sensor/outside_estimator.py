"""Another position estimator beside odometry and views, as one more hypothesis; now and then it is wrong."""

import math
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage, State
from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.values.belief import GaussianMixture
from omninav.stages.values.pose import Pose

EVERY_M = 5.0
"""Distance driven between two statements, metres; a log's first image has one."""
SIGMA_M, SIGMA_DEG = 0.3, 10.0
"""Standard deviations of the position, in x and y, and of the heading."""
WRONG_M = 8.0
"""Distance of a wrong estimate from the truth, metres."""
WEIGHT = 1.0
"""Weight against the other sources, whose weights sum to about 1."""


class OutsideEstimatorState(State):
    """Metres driven since the last statement, and the last position (x, y)."""

    since_m: float = math.inf
    position: tuple[float, float] | None = None


class OutsideEstimator(Stage):
    """Simulates an external estimator: a noisy pose every few metres, sometimes a wrong one.

    Gross, Koenig & Müller 2005, sections 1 and 2.1: "state hypotheses from other sources of information" are fused as
    motion and views are. Errors are drawn from Gaussians around the true pose; a wrong statement is `WRONG_M` away
    from it in any direction, and claims to be as exact as the others. Absent between statements and without truth.
    """

    wrong: Annotated[float, Bounds(ge=0, le=1)] = 0.0
    """Share of the statements that are wrong."""

    class Out(Outputs):
        """`hypothesis`: one Gaussian; `wrong`: the same where it is wrong."""

        hypothesis: GaussianMixture | None = None
        wrong: GaussianMixture | None = None

    def step(self, ctx: Context, truth: Pose | None, state: OutsideEstimatorState) -> Out:
        """State the pose where that is due."""
        if ctx.tick.first_of_log:
            state.since_m, state.position = math.inf, None
        if truth is None:
            return self.Out()
        if state.position is not None:
            state.since_m += math.hypot(truth.x - state.position[0], truth.y - state.position[1])
        state.position = (truth.x, truth.y)
        if state.since_m < EVERY_M:
            return self.Out()
        state.since_m = 0.0
        sigmas = np.array([SIGMA_M, SIGMA_M, math.radians(SIGMA_DEG)])
        mean = np.array([truth.x, truth.y, truth.heading]) + sigmas * ctx.rng.standard_normal(3)
        is_wrong, direction = ctx.rng.random() < self.wrong, 2.0 * math.pi * ctx.rng.random()
        if is_wrong:
            mean[:2] += WRONG_M * np.array([math.cos(direction), math.sin(direction)])
        mean[2] = wrap(mean[2])
        stated = GaussianMixture(mean[None], np.diag(sigmas**2)[None], np.array([WEIGHT]))
        return self.Out(hypothesis=stated, wrong=stated if is_wrong else None)
