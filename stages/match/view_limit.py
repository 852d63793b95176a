"""How far apart two views of one place may be."""

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


class FixedLimit(Stage):
    """A given distance between views, in their own unit."""

    distance: Annotated[float, Bounds(gt=0)] = 100.0

    class Out(Outputs):
        """The limit."""

        limit: ViewLimit

    def step(self, ctx: Context) -> Out:
        """Give it."""
        return self.Out(limit=ViewLimit(self.distance))


class FirstViews(State):
    """The first views of a drive (n, D), all distances between two of them, and metres since the last was taken.

    Both are let go of once the limit is `settled`.
    """

    views: FloatArray = field(default_factory=lambda: np.zeros((0, 0), np.float32))
    distances: Array = field(default_factory=lambda: np.zeros(0))
    since: float = 0.0
    limit: float = 0.0
    settled: bool = False


class FirstViewsLimit(Stage):
    """A share of the median distance between any two of the drive's first views.

    The threshold of Porta & Kröse 2004 (delta_y) and Gross, Koenig & Müller 2005 (E_max), who do not say how they set
    it, in the views' own unit. Most of those pairs are strangers, and strangers are about equally far from each other
    in all recordings: one share does for all of them (docs/experiments/cml_view_limit.md). The first `views` views
    count between which the robot moved by `least_m`. Until then the limit is that of the views so far, and not
    settled; the very first has none. It is settled in the first log and holds for all that follow. Manifest fact
    `view_limit`.
    """

    share: Annotated[float, Bounds(gt=0, le=1)] = 0.65
    views: Annotated[int, Bounds(ge=2)] = 100
    least_m: Annotated[float, Bounds(ge=0)] = 0.01

    class Out(Outputs):
        """The limit, once there is one."""

        limit: ViewLimit | None = None

    def step(self, ctx: Context, view: WholeView, motion: Motion | None, first: FirstViews) -> Out:
        """Take one view in."""
        if not first.settled and self._has_moved(motion, first):
            self._take(view, first)
            ctx.fact("view_limit", round(first.limit, 4))
        return self.Out(limit=ViewLimit(first.limit, first.settled) if first.limit > 0.0 else None)

    def _has_moved(self, motion: Motion | None, first: FirstViews) -> bool:
        first.since += math.inf if motion is None else math.hypot(motion.x, motion.y)
        moved = first.since >= self.least_m
        if moved:
            first.since = 0.0
        return moved

    def _take(self, view: WholeView, first: FirstViews) -> None:
        if len(first.views):
            first.distances = np.append(first.distances, view.distances(first.views))
            first.limit = self.share * float(np.median(first.distances))
        first.views = np.concatenate([first.views.reshape(-1, len(view.values)), view.values[None]])
        if len(first.views) >= self.views:
            first.settled, first.views, first.distances = True, first.views[:0], first.distances[:0]
