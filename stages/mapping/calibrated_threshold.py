"""A limit that is measured on a drive's first views."""

import math
from dataclasses import field
from typing import Annotated

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Context, Outputs, Stage, State
from omninav.stages.values.pose import Motion
from omninav.stages.values.view_mixtures import ViewMixtures
from omninav.stages.values.views import NoveltyThreshold, WholeView

Array = npt.NDArray[np.float64]
FloatArray = npt.NDArray[np.float32]


class CalibratedThresholdState(State):
    """The limit so far, and what it is measured on, which is let go of once it is settled.

    `views`: (n, D). `table`: the distances of each to all before it. `ways`: metres to each from the one before.
    `since`: metres since the last.
    """

    limit: NoveltyThreshold | None = None
    views: FloatArray = field(default_factory=lambda: np.zeros((0, 0), np.float32))
    table: list[Array] = field(default_factory=list)
    ways: list[float] = field(default_factory=list)
    since: float = 0.0


class CalibratedThreshold(Stage):
    """A share of the median distance between a drive's first views that are `apart` views or more from each other.

    A threshold in the views' unit that follows from the drive itself: delta_y of Porta & Kröse 2004, E_max of Gross,
    Koenig & Müller 2005, who do not say how they set theirs. Distances grow with the way between two views up to what
    views of different places have, and stay there, about equally far in all recordings: one share does for all of them
    (docs/experiments/cml_view_limit.md), for slow robots and fast ones, near walls and far ones, which a distance
    between successive views does not (docs/experiments/cml_defaults.md). `apart` 1: any two views.

    The first `views` views between which the robot moved by `least_m` count; until then the limit follows from those so
    far, not settled, and there is none before the first pair. It is settled in the first log and holds for all that
    follow; a map keeps it, and where there is a `known` one that has it, nothing is measured. Manifest fact
    `view_limit`. The limit says how many metres a robot drives until it is reached.
    """

    views: Annotated[int, Bounds(ge=2)] = 100
    apart: Annotated[int, Bounds(ge=1)] = 20
    share: Annotated[float, Bounds(gt=0)] = 0.5
    least_m: Annotated[float, Bounds(ge=0)] = 0.01

    class Out(Outputs):
        """The limit, once there is one."""

        threshold: NoveltyThreshold | None = None

    def __post_init__(self) -> None:
        """There must be a pair."""
        if self.apart >= self.views:
            raise ValueError(f"apart: of {self.views} views none are {self.apart} apart")

    def step(
        self,
        ctx: Context,
        view: WholeView,
        motion: Motion | None,
        first: CalibratedThresholdState,
        known: ViewMixtures | None = None,
    ) -> Out:
        """Take one view in."""
        if first.limit is None and known is not None and known.limit is not None:
            first.limit = known.limit
            ctx.fact("view_limit", round(first.limit.distance, 4))
        if first.limit is None or not first.limit.settled:
            first.since += 0.0 if motion is None else math.hypot(motion.x, motion.y)
            if not len(first.views) or first.since >= self.least_m:
                take_in(view, first)
                self._measure(ctx, first)
        return self.Out(threshold=first.limit)

    def _measure(self, ctx: Context, first: CalibratedThresholdState) -> None:
        pairs = np.concatenate([distances[: max(len(distances) + 1 - self.apart, 0)] for distances in first.table])
        if not len(pairs):
            return
        distance = self.share * float(np.median(pairs))
        ctx.fact("view_limit", round(distance, 4))
        settled = len(first.views) >= self.views
        first.limit = NoveltyThreshold(distance, settled, way_beyond(distance, first.table, first.ways))
        if settled:
            first.views, first.table, first.ways = first.views[:0], [], []


def take_in(view: WholeView, first: CalibratedThresholdState) -> None:
    """Add a view to the first ones."""
    first.table.append(view.distances(first.views) if len(first.views) else np.zeros(0))
    first.views = np.concatenate([first.views.reshape(-1, len(view.values)), view.values[None]])
    first.ways.append(first.since)
    first.since = 0.0


def way_beyond(limit: float, table: list[Array], ways: list[float]) -> float:
    """The median way from a view to the next one beyond the limit (m), 0 where there is none; arguments: CalibratedThresholdState."""
    at = np.cumsum(ways)
    found = []
    for row in range(len(at)):
        later = (at[column] for column in range(row + 1, len(at)) if table[column][row] >= limit)
        beyond = next(later, None)
        if beyond is not None:
            found.append(beyond - at[row])
    return float(np.median(found)) if found else 0.0
