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
    """The first views of a drive (n, D), how far each is from the one `apart` before, and metres since the last."""

    views: FloatArray = field(default_factory=lambda: np.zeros((0, 0), np.float32))
    distances: Array = field(default_factory=lambda: np.zeros(0))
    since: float = 0.0
    settled: bool = False


class FirstViewsLimit(Stage):
    """The median distance between views that are `apart` views from each other, over the drive's first ones.

    A threshold in the views' unit that follows from the drive itself: delta_y of Porta & Kröse 2004, E_max of Gross,
    Koenig & Müller 2005, who do not say how they set theirs. The first `views` views between which the robot moved by
    `least_m` count; until then the limit is the median so far, not settled, and absent for the first view. It is
    settled in the first log and holds for all that follow. Manifest fact `view_limit`.
    """

    views: Annotated[int, Bounds(ge=2)] = 30
    apart: Annotated[int, Bounds(ge=1)] = 3
    least_m: Annotated[float, Bounds(ge=0)] = 0.01

    class Out(Outputs):
        """The limit, once there is one."""

        limit: ViewLimit | None = None

    def step(self, ctx: Context, view: WholeView, motion: Motion | None, first: FirstViews) -> Out:
        """Take one view in."""
        if not first.settled:
            self._measure(view, motion, first)
        if not len(first.distances):
            return self.Out()
        distance = float(np.median(first.distances))
        ctx.fact("view_limit", round(distance, 4))
        return self.Out(limit=ViewLimit(distance, first.settled))

    def _measure(self, view: WholeView, motion: Motion | None, first: FirstViews) -> None:
        first.since += 0.0 if motion is None else math.hypot(motion.x, motion.y)
        if len(first.views) and first.since < self.least_m:
            return
        first.since = 0.0
        if len(first.views):
            before = first.views[-min(self.apart, len(first.views))]
            first.distances = np.append(first.distances, view.distances(before[None])[0])
        first.views = np.concatenate([first.views.reshape(-1, len(view.values)), view.values[None]])
        first.settled = len(first.views) >= self.views
