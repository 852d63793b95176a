"""A map of views whose places are fused with the state that was believed each time they were seen."""

import math
from dataclasses import field
from typing import Annotated, Literal

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.geometry.appearance.view_similarity import similarity
from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.geometry.probability.gaussians import merged
from omninav.stages.values.belief import GaussianMixture
from omninav.stages.values.map_update import MapUpdate, MapUpdates
from omninav.stages.values.view_mixtures import ViewEvent, ViewMixtures
from omninav.stages.values.views import NoveltyThreshold

from .applied_update import AppliedUpdate, taught_by
from .before_threshold import BeforeThreshold, due
from .view_cap import within_cap
from .view_events import view_event

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Parts = tuple[Array, Array, Array, Array]
Average = Literal["visits", "halves"]


class FusedMixturesState(BeforeThreshold):
    """Lessons that wait for a limit, and those that can be taken back."""

    open: list[AppliedUpdate] = field(default_factory=list)


class FusedMixtures(Stage):
    """A view that is new becomes a map point; one that is known adds its state to those it resembles, half and half.

    Porta & Kroese 2004, section 3.2. A view is new where none in the map is within the limit (delta_y); it is stored
    with the state in which it was seen. Else each view within the limit takes that state in, its headings turned to the
    stored view's: the two mixtures side by side, the closest pairs merged while their squared Mahalanobis distance is
    below `merge_below` (7.81: places that are the same at 95 %), weights made to sum to 1, and components below
    `least_weight` dropped. So a place that is not confirmed loses half of its weight each time, and is gone after the
    seventh at 0.01. MapUpdates wait until there is a limit, all but the first view of a map. `spread`: whether a merged
    covariance holds how far apart the two means were; the paper's does not and is over-confident (erratum 16).
    `max_views` 0: no limit; else the weakest views go first.

    `average`: how much each counts where components become one. `halves`: by their weights, as in the paper: the last
    state counts as much as all before, so that a place follows the last one or two, which had come from the map
    itself, and the map drifts (docs/experiments/cml_defaults.md). `visits`: each state alike, but for how alike the
    two views are (S from 1 to 0 at the limit): eta of Gross, Koenig & Mueller 2005, equations 11 to 14. How much a
    place weighs against the others of its view is the paper's either way.

    MapUpdates that may be given again (`MapUpdates.open_from`) are taken back when they are: all since the first of them is
    undone, and learned again with the states as they are known now. No view comes or goes by it.
    """

    merge_below: Annotated[float, Bounds(ge=0)] = 7.81
    spread: bool = True
    average: Average = "visits"
    least_weight: Annotated[float, Bounds(ge=0, lt=0.5)] = 0.01
    max_views: Annotated[int, Bounds(ge=0)] = 0

    class Out(Outputs):
        """The map, and what this tick did to it."""

        map: ViewMixtures
        events: ViewEvent | None = None

    def step(
        self,
        ctx: Context,
        updates: MapUpdates | None,
        threshold: NoveltyThreshold | None,
        map: ViewMixtures,
        learned: FusedMixturesState,
    ) -> Out:
        """Learn from what this tick has to teach."""
        map.take_limit(threshold)
        updates = MapUpdates(()) if updates is None else updates
        open_from = math.inf if updates.open_from is None else updates.open_from
        learned.open = [taught for taught in learned.open if taught.index >= open_from]
        before = map.names.copy()
        new, changed = (
            self._put_right(ctx, updates.items, learned, map) if open_from < math.inf else (updates.items, [])
        )
        seen: dict[int, int] = {}
        for lesson in due(new, threshold, map, learned):
            seen[map.next_name] = lesson.index  # if it is a new one
            taught = self._learn(lesson, threshold, map)
            changed.append(taught.names)
            if lesson.index >= open_from:
                learned.open.append(taught)
        if not changed:
            return self.Out(map=map)
        over = within_cap(map, self.max_views)
        if not over.all():
            map.keep_views(over)
            learned.open = [taught.within(map) for taught in learned.open]
        why: Literal["", "full"] = "" if over.all() else "full"
        return self.Out(map=map, events=view_event(map, before, np.concatenate(changed), seen, why))

    def _put_right(
        self, ctx: Context, lessons: tuple[MapUpdate, ...], learned: FusedMixturesState, map: ViewMixtures
    ) -> tuple[tuple[MapUpdate, ...], list[Ints]]:
        # Those of the lessons that are new, and the names of the views that changed because of the others.
        fresh = {lesson.index: lesson for lesson in lessons}
        learned.waiting = [fresh.pop(lesson.index, lesson) for lesson in learned.waiting]
        first = next((row for row, taught in enumerate(learned.open) if taught.index in fresh), len(learned.open))
        again, learned.open = learned.open[first:], learned.open[:first]
        for taught in reversed(again):
            taught.undo(map)
        for taught in again:
            state = fresh.pop(taught.index).state if taught.index in fresh else taught.state
            learned.open.append(self._take_in(state, taught.index, taught.names, taught.turns, taught.alike, map))
        if again:
            ctx.count("lesson_taken_back", len(lessons) - len(fresh))
        return tuple(fresh.values()), [taught.names for taught in again]

    def _learn(self, lesson: MapUpdate, limit: NoveltyThreshold | None, map: ViewMixtures) -> AppliedUpdate:
        view = lesson.view
        distances = view.distances(map.views) if len(map) and limit else np.empty(0)
        rows = np.flatnonzero(distances < limit.distance) if limit else np.empty(0, np.int64)
        if limit and len(rows):
            alike, turns = similarity(distances[rows], limit.distance, "linear"), view.turns(map.views[rows])
        else:
            rows = np.array([map.add_view(view.values, type(view).__name__)])
            alike, turns = np.ones(1), np.zeros(1)
        map.step()
        return self._take_in(lesson.state, lesson.index, map.names[rows], turns, alike, map)

    def _take_in(
        self, state: GaussianMixture, index: int, names: Ints, turns: Array, alike: Array, map: ViewMixtures
    ) -> AppliedUpdate:
        taught = taught_by(state, index, names, turns, alike, map)
        mixtures = [
            fused([places, parts(state, turn, s)], self.merge_below, self.spread, self.least_weight, self.average)
            for places, turn, s in zip(taught.places(), turns.tolist(), alike.tolist(), strict=True)
        ]
        owners = np.repeat(taught.rows(map), [len(weights) for _, _, weights, _ in mixtures])
        if mixtures:
            map.put_mixtures(owners, *(np.concatenate(fields) for fields in zip(*mixtures, strict=True)))
        return taught


def parts(state: GaussianMixture, turn: float, alike: float) -> Parts:
    """A state as places of a view from which the robot stood turned by `turn`, counter-clockwise: means, covariances,
    weights, and counts, `alike` (S) in all.
    """
    means = state.means.copy()
    means[:, 2] = wrap(means[:, 2] - turn)
    return means, state.covariances, state.weights, state.weights * alike


def fused(mixtures: list[Parts], merge_below: float, spread: bool, least_weight: float, average: Average) -> Parts:
    """Mixtures of equal say as one: close components merged, weights made to sum to 1, weak ones dropped; where all are
    weak the heaviest stays.
    """
    means, covariances, weights, counts = (np.concatenate(rows) for rows in zip(*mixtures, strict=True))
    if average == "visits":
        means, covariances, counts, weights = merged(means, covariances, counts, merge_below, spread, weights)
    else:
        means, covariances, weights, counts = merged(means, covariances, weights, merge_below, spread, counts)
    weights = weights / weights.sum()
    kept = weights >= min(least_weight, weights.max())
    weights = weights[kept] / weights[kept].sum()
    return means[kept], covariances[kept], weights, counts[kept]
