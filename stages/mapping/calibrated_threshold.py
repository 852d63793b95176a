"""A novelty threshold measured on a drive's first views."""

import math
from dataclasses import field
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage, State
from omninav.stages.geometry.arrays import Array, Floats
from omninav.stages.values.pose import Motion
from omninav.stages.values.view_mixtures import ViewMixtures
from omninav.stages.values.views import NoveltyThreshold, WholeView

MIN_MOVE_M = 0.01
"""Distance driven between two views that count, metres."""


class CalibratedThresholdState(State):
    """The threshold so far, and the views it is measured on, which are released once it is settled.

    `views`: (n, D). `table`: the distances of each to all before it. `gaps_m`: distance driven to each from the one
    before. `since_m`: distance driven since the last.
    """

    threshold: NoveltyThreshold | None = None
    views: Floats = field(default_factory=lambda: np.zeros((0, 0), np.float32))
    table: list[Array] = field(default_factory=list)
    gaps_m: list[float] = field(default_factory=list)
    since_m: float = 0.0


class CalibratedThreshold(Stage):
    """Sets the threshold to a share of the median distance between a drive's first views.

    delta_y of Porta & Kröse 2004, E_max of Gross, Koenig & Müller 2005, who do not state how they chose theirs.
    Distances between views grow with the distance driven up to that of different places, about equal in all recordings,
    so that one share fits all (docs/experiments/cml_view_limit.md), slow robots and fast ones. Distances between
    successive views do not (docs/experiments/cml_defaults.md).

    Until `views` views have been seen the threshold follows from those so far and is not settled; before the first pair
    there is none. It is settled in the first log and holds for all that follow. A map keeps it: where `known` has one,
    nothing is measured. Manifest fact `novelty_threshold`.
    """

    views: Annotated[int, Bounds(ge=2)] = 100
    """First views that are measured."""
    min_separation: Annotated[int, Bounds(ge=1)] = 20
    """Views between the two of a pair, at least; 1: all pairs."""
    share: Annotated[float, Bounds(gt=0)] = 0.5
    """Share of the median distance."""

    class Out(Outputs):
        threshold: NoveltyThreshold | None = None

    def __post_init__(self) -> None:
        """There must be a pair of views."""
        if self.min_separation >= self.views:
            raise ValueError(f"min_separation: of {self.views} views none are {self.min_separation} apart")

    def step(
        self,
        ctx: Context,
        view: WholeView,
        motion: Motion | None,
        state: CalibratedThresholdState,
        known: ViewMixtures | None = None,
    ) -> Out:
        if state.threshold is None and known is not None and known.threshold is not None:
            state.threshold = known.threshold
            ctx.fact("novelty_threshold", round(state.threshold.distance, 4))
        if state.threshold is None or not state.threshold.settled:
            state.since_m += 0.0 if motion is None else math.hypot(motion.x, motion.y)
            if not len(state.views) or state.since_m >= MIN_MOVE_M:
                add_view(view, state)
                self._measure(ctx, state)
        return self.Out(threshold=state.threshold)

    def _measure(self, ctx: Context, state: CalibratedThresholdState) -> None:
        pairs = np.concatenate(
            [distances[: max(len(distances) + 1 - self.min_separation, 0)] for distances in state.table]
        )
        if not len(pairs):
            return
        distance = self.share * float(np.median(pairs))
        ctx.fact("novelty_threshold", round(distance, 4))
        settled = len(state.views) >= self.views
        state.threshold = NoveltyThreshold(distance, settled, distance_to_new_view(distance, state.table, state.gaps_m))
        if settled:
            state.views, state.table, state.gaps_m = state.views[:0], [], []


def add_view(view: WholeView, state: CalibratedThresholdState) -> None:
    """Add a view to the measured ones."""
    state.table.append(view.distances(state.views) if len(state.views) else np.zeros(0))
    state.views = np.concatenate([state.views.reshape(-1, len(view.values)), view.values[None]])
    state.gaps_m.append(state.since_m)
    state.since_m = 0.0


def distance_to_new_view(threshold: float, table: list[Array], gaps_m: list[float]) -> float:
    """The median distance (m) from a view to the next one beyond the threshold, 0 where there is none.

    `table`, `gaps_m`: see CalibratedThresholdState.
    """
    at = np.cumsum(gaps_m)
    found = []
    for row in range(len(at)):
        later = (at[column] for column in range(row + 1, len(at)) if table[column][row] >= threshold)
        beyond = next(later, None)
        if beyond is not None:
            found.append(beyond - at[row])
    return float(np.median(found)) if found else 0.0
