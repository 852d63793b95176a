"""How far apart views are that have nothing in common: a yardstick for those that have."""

import math
from dataclasses import field
from typing import Annotated

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Context, Outputs, Stage, State
from omninav.stages.values.pose import Motion
from omninav.stages.values.views import ViewLimit, WholeView

Array = npt.NDArray[np.float64]
FloatArray = npt.NDArray[np.float32]


class YardstickViews(State):
    """The first views of a drive (n, D), distances between those far from each other, and metres since the last.

    `ways`: (n,) metres to each from the one before. `table`: distances of each to all before it. `metres`: how far to
    drive until views are beyond the limit.
    """

    views: FloatArray = field(default_factory=lambda: np.zeros((0, 0), np.float32))
    distances: Array = field(default_factory=lambda: np.zeros(0))
    since: float = 0.0
    ways: Array = field(default_factory=lambda: np.zeros(0))
    table: list[Array] = field(default_factory=list)
    metres: float = 0.0


class UnrelatedViewsLimit(Stage):
    """A share of the median distance between views that are `apart` views or more from each other, at a drive's start.

    A threshold in the views' unit that follows from the drive itself: delta_y of Porta & Kröse 2004, E_max of Gross,
    Koenig & Müller 2005, who do not say how they set theirs. Distances grow with the way between two views up to what
    views of different places have, and stay there: half of that is in between for slow robots and fast ones, near walls
    and far ones, which a distance between successive views is not (docs/experiments/cml_defaults.md). The first
    `views` views between which the robot moved by `least_m` count; until then the limit follows from those so far, not
    settled, and there is none before the first pair. It is settled in the first log and holds for all that follow.
    Manifest fact `view_limit`. Once settled, the limit says how many metres a robot drives until it is reached: the
    median way from one of these views to the next one beyond the limit.
    """

    views: Annotated[int, Bounds(ge=2)] = 100
    apart: Annotated[int, Bounds(ge=1)] = 20
    share: Annotated[float, Bounds(gt=0)] = 0.5
    least_m: Annotated[float, Bounds(ge=0)] = 0.01

    class Out(Outputs):
        """The limit, once there is one."""

        limit: ViewLimit | None = None

    def __post_init__(self) -> None:
        """There must be a pair."""
        if self.apart >= self.views:
            raise ValueError(f"apart: of {self.views} views none are {self.apart} apart")

    def step(self, ctx: Context, view: WholeView, motion: Motion | None, first: YardstickViews) -> Out:
        """Take one view in."""
        settled = len(first.views) >= self.views
        if not settled:
            first.since += 0.0 if motion is None else math.hypot(motion.x, motion.y)
            if not len(first.views) or first.since >= self.least_m:
                self._take_in(view, first)
                settled = len(first.views) >= self.views
                if settled:
                    first.metres = _reach(first, self.share * float(np.median(first.distances)))
        if not len(first.distances):
            return self.Out()
        distance = self.share * float(np.median(first.distances))
        ctx.fact("view_limit", round(distance, 4))
        return self.Out(limit=ViewLimit(distance, settled, first.metres))

    def _take_in(self, view: WholeView, first: YardstickViews) -> None:
        distances = view.distances(first.views) if len(first.views) else np.zeros(0)
        first.table.append(distances)
        first.distances = np.append(first.distances, distances[: max(len(distances) + 1 - self.apart, 0)])
        first.views = np.concatenate([first.views.reshape(-1, len(view.values)), view.values[None]])
        first.ways = np.append(first.ways, first.since)
        first.since = 0.0


def _reach(first: YardstickViews, limit: float) -> float:
    # The median way from a view to the next one beyond the limit.
    at = np.cumsum(first.ways)
    reaches = []
    for row in range(len(at)):
        later = (at[column] for column in range(row + 1, len(at)) if first.table[column][row] >= limit)
        beyond = next(later, None)
        if beyond is not None:
            reaches.append(beyond - at[row])
    return float(np.median(reaches)) if reaches else 0.0
