"""Poses that somebody states: a hypothesis beside what the robot sees."""

import math
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage, State
from omninav.stages.values.belief import GaussianMixture
from omninav.stages.values.pose import Pose


class Stated(State):
    """The way (m) since a pose was last stated and since the log began, and where the robot was just before (x, y)."""

    way: float = math.inf
    gone: float = 0.0
    at: tuple[float, float] | None = None


class PoseFixes(Stage):
    """States the robot's true pose now and then, as a Gaussian: a manual position calibration.

    "While building the map for the first time, supplementary localization information could be given to achieve a
    higher initial precision" (Gross, Koenig & Mueller 2005, section 3). It is one more hypothesis for the fusion, and
    the only way by which truth gets into a map that is learned while it is used: only where it is configured.

    A pose is stated at a log's first picture and then each time when at least `every_m` metres have been gone since (0:
    at each picture). `places`: only within `near_m` metres of one of these (x, y in m; none: anywhere). `logs`: only in
    these logs, counted from 0 (none: in all). `first_m`: only on so many metres of a log's way (0: on all). `sigma_m`,
    `sigma_rad`: how exact it is said to be. `weight`: how much it counts beside the others, whose weights sum to about
    1. Absent, and counted, where the log says no true pose.
    """

    every_m: Annotated[float, Bounds(ge=0)] = 0.0
    places: tuple[tuple[float, float], ...] = ()
    near_m: Annotated[float, Bounds(gt=0)] = 0.5
    logs: tuple[int, ...] = ()
    first_m: Annotated[float, Bounds(ge=0)] = 0.0
    sigma_m: Annotated[float, Bounds(gt=0)] = 0.05
    sigma_rad: Annotated[float, Bounds(gt=0)] = 0.02
    weight: Annotated[float, Bounds(gt=0)] = 1.0

    class Out(Outputs):
        """One Gaussian at the true pose; absent where none is stated."""

        hypothesis: GaussianMixture | None = None

    def step(self, ctx: Context, truth: Pose | None, stated: Stated) -> Out:
        """State the pose, where it is time."""
        if ctx.tick.first_of_log:
            stated.way, stated.gone, stated.at = math.inf, 0.0, None
        if self.logs and ctx.tick.log not in self.logs:
            return self.Out()
        if truth is None:
            ctx.count("no_pose_to_state", detail="calibration: this picture has no true pose; none is stated")
            return self.Out()
        if stated.at is not None:
            moved = math.hypot(truth.x - stated.at[0], truth.y - stated.at[1])
            stated.way, stated.gone = stated.way + moved, stated.gone + moved
        stated.at = (truth.x, truth.y)
        over = self.first_m > 0.0 and stated.gone > self.first_m
        if over or stated.way < self.every_m or not self._in_place(truth):
            return self.Out()
        stated.way = 0.0
        sigmas = np.array([self.sigma_m, self.sigma_m, self.sigma_rad])
        mean = np.array([[truth.x, truth.y, truth.heading]])
        return self.Out(hypothesis=GaussianMixture(mean, np.diag(sigmas**2)[None], np.array([self.weight])))

    def _in_place(self, truth: Pose) -> bool:
        gaps = [math.hypot(truth.x - x, truth.y - y) for x, y in self.places]
        return not gaps or min(gaps) <= self.near_m
