"""A map of views whose places are fused with the state that was believed each time they were seen."""

from dataclasses import field
from typing import Annotated, Literal

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Context, Outputs, Stage, State
from omninav.stages.geometry.gaussians import merged
from omninav.stages.geometry.se2 import wrap
from omninav.stages.values.belief import GaussianMixture
from omninav.stages.values.lesson import Lesson, Lessons
from omninav.stages.values.view_mixtures import ViewEvent, ViewMixtures
from omninav.stages.values.views import ViewLimit

from .view_cap import within_cap
from .view_events import view_event

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Parts = tuple[Array, Array, Array, Array]


class Unjudged(State):
    """Lessons that came before there was a limit that says which views are new."""

    lessons: list[Lesson] = field(default_factory=list)


class FusedMixtures(Stage):
    """A view that is new becomes a map point; one that is known adds its state to those it resembles, half and half.

    Porta & Kroese 2004, section 3.2. A view is new where none in the map is within the limit (delta_y); it is stored
    with the state in which it was seen. Else each view within the limit takes that state in, its headings turned to the
    stored view's: the two mixtures side by side, the closest pairs merged while their squared Mahalanobis distance is
    below `merge_below` (7.81: places that are the same at 95 %), weights made to sum to 1, and components below
    `least_weight` dropped. So a place that is not confirmed loses half of its weight each time, and is gone after the
    seventh at 0.01. Lessons wait until there is a limit, all but the first view of a map. `spread`: whether a merged
    covariance holds how far apart the two means were; the paper's does not and is over-confident (erratum 16).
    `max_views` 0: no limit; else the weakest views go first.
    """

    merge_below: Annotated[float, Bounds(ge=0)] = 7.81
    spread: bool = True
    least_weight: Annotated[float, Bounds(ge=0, lt=0.5)] = 0.01
    max_views: Annotated[int, Bounds(ge=0)] = 0

    class Out(Outputs):
        """The map, and what this tick did to it."""

        map: ViewMixtures
        events: ViewEvent | None = None

    def step(
        self, ctx: Context, lessons: Lessons | None, limit: ViewLimit | None, map: ViewMixtures, unjudged: Unjudged
    ) -> Out:
        """Learn from what this tick has to teach."""
        unjudged.lessons += () if lessons is None else lessons.items
        if not unjudged.lessons or (limit is None and len(map)):
            return self.Out(map=map)
        before = map.names.copy()
        now = len(unjudged.lessons) if limit is not None else 1
        changed = [name for lesson in unjudged.lessons[:now] for name in self._learn(lesson, limit, map)]
        unjudged.lessons = unjudged.lessons[now:]
        over = within_cap(map, self.max_views)
        map.keep_views(over)
        why: Literal["", "full"] = "" if over.all() else "full"
        return self.Out(map=map, events=view_event(map, before, np.array(changed, np.int64), why))

    def _learn(self, lesson: Lesson, limit: ViewLimit | None, map: ViewMixtures) -> list[int]:
        # The names of the views that took the lesson in.
        view, state = lesson.view, lesson.state
        rows = np.flatnonzero(view.distances(map.views) < limit.distance) if len(map) and limit else np.empty(0, int)
        if len(rows):
            turns = view.turns(map.views[rows]).tolist()
            mixtures = [
                self._fused([stored(map, row), parts(state, turn)])
                for row, turn in zip(rows.tolist(), turns, strict=True)
            ]
        else:
            rows = np.array([map.add_view(view.values, type(view).__name__)])
            mixtures = [self._fused([parts(state, 0.0)])]
        owners = np.repeat(rows, [len(weights) for _, _, weights, _ in mixtures])
        map.put_mixtures(owners, *(np.concatenate(fields) for fields in zip(*mixtures, strict=True)))
        map.step()
        return [int(name) for name in map.names[rows]]

    def _fused(self, mixtures: list[Parts]) -> Parts:
        return fused(mixtures, self.merge_below, self.spread, self.least_weight)


def stored(map: ViewMixtures, row: int) -> Parts:
    """A view's places: means, covariances, weights, counts."""
    mine = map.owner == row
    return map.means[mine], map.covariances[mine], map.weights[mine], map.counts[mine]


def parts(state: GaussianMixture, turn: float) -> Parts:
    """A state as places of a view from which the robot stood turned by `turn`, counter-clockwise."""
    means = state.means.copy()
    means[:, 2] = wrap(means[:, 2] - turn)
    return means, state.covariances, state.weights, state.weights


def fused(mixtures: list[Parts], merge_below: float, spread: bool, least_weight: float) -> Parts:
    """Mixtures of equal say as one: close components merged, weights made to sum to 1, weak ones dropped."""
    means, covariances, weights, counts = (np.concatenate(rows) for rows in zip(*mixtures, strict=True))
    means, covariances, weights, counts = merged(means, covariances, weights, merge_below, spread, counts)
    weights = weights / weights.sum()
    kept = weights >= least_weight
    weights = weights[kept] / weights[kept].sum()
    return means[kept], covariances[kept], weights, counts[kept]
