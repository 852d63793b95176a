"""A map of views that fuses each view's mixture with the states in which it is seen."""

import math
from dataclasses import field
from typing import Annotated, Literal

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.geometry.appearance.view_similarity import similarity
from omninav.stages.geometry.arrays import Array, Ints
from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.geometry.probability.gaussians import merged
from omninav.stages.values.belief import GaussianMixture
from omninav.stages.values.map_update import MapUpdate, MapUpdates
from omninav.stages.values.view_mixtures import ViewEvent, ViewMixtures
from omninav.stages.values.views import NoveltyThreshold

from .applied_update import AppliedUpdate, record_update
from .view_updates import PendingUpdates, ready_updates, start_over, view_event, within_cap

Parts = tuple[Array, Array, Array, Array]
Average = Literal["visits", "halves"]
MERGE_BELOW = 7.81
"""Squared Mahalanobis distance below which components are merged: equal at 95 %."""
MIN_WEIGHT = 0.01
"""Weight below which a component is removed."""


class FusedMixturesState(PendingUpdates):
    """Updates that wait for a threshold, and applied ones that can be undone."""

    open: list[AppliedUpdate] = field(default_factory=list)


class FusedMixtures(Stage):
    """Inserts new views as map points; fuses the mixtures of known ones with the state, half and half.

    Porta & Kroese 2004, section 3.2. A view is new where none in the map is within the threshold (delta_y): it is
    inserted with the state in which it was seen. Otherwise each view within the threshold is fused with that state, its
    headings turned to the stored view's: both mixtures side by side, the closest pairs merged, weights normalised,
    light components dropped. So an unconfirmed component loses half of its weight each time. Updates wait until there
    is a threshold, all but a map's first.

    Updates that are repeated (`MapUpdates.open_from`) replace the earlier ones: all since the first of them are undone
    and applied redone with the new states. No view is inserted or removed by this.
    """

    spread: bool = True
    """Whether a merged covariance includes the spread of the means; the paper's does not and is over-confident
    (erratum 16 in docs/papers.md)."""
    average: Average = "visits"
    """Shares of merged components. `halves`: their weights, as in the paper: the last state counts as much as all
    before, so that the map drifts (docs/experiments/cml_defaults.md). `visits`: the number of visits, weighted by
    similarity (eta of Gross, Koenig & Mueller 2005, equations 11 to 14)."""
    max_views: Annotated[int, Bounds(ge=0)] = 0
    """Views of the map, above which the weakest are removed; 0: no limit."""

    class Out(Outputs):
        """The map and its changes in this tick."""

        map: ViewMixtures
        events: ViewEvent | None = None

    def step(
        self,
        ctx: Context,
        updates: MapUpdates | None,
        threshold: NoveltyThreshold | None,
        map: ViewMixtures,
        pending: FusedMixturesState,
    ) -> Out:
        map.keep_threshold(threshold)
        updates = MapUpdates(()) if updates is None else updates
        open_from = math.inf if updates.open_from is None else updates.open_from
        pending.open = [] if updates.relearn else [applied for applied in pending.open if applied.index >= open_from]
        before = map.ids.copy()
        start_over(updates, map, pending)
        new, changed = self._redo(ctx, updates.items, pending, map) if open_from < math.inf else (updates.items, [])
        seen: dict[int, int] = {}
        for update in ready_updates(new, threshold, map, pending):
            seen[map.next_id] = update.index  # if it is a new one
            applied = self._apply(update, threshold, map)
            changed.append(applied.ids)
            if update.index >= open_from:
                pending.open.append(applied)
        if not changed:
            return self.Out(map=map)
        over = within_cap(map, self.max_views)
        if not over.all():
            map.keep_views(over)
            pending.open = [applied.within(map) for applied in pending.open]
        why: Literal["", "full"] = "" if over.all() else "full"
        return self.Out(map=map, events=view_event(map, before, np.concatenate(changed), seen, why))

    def _redo(
        self, ctx: Context, updates: tuple[MapUpdate, ...], pending: FusedMixturesState, map: ViewMixtures
    ) -> tuple[tuple[MapUpdate, ...], list[Ints]]:
        # Gives the updates that are new, and the ids of the views that the others changed.
        new = {update.index: update for update in updates}
        pending.waiting = [new.pop(update.index, update) for update in pending.waiting]
        first = next((row for row, applied in enumerate(pending.open) if applied.index in new), len(pending.open))
        redone, pending.open = pending.open[first:], pending.open[:first]
        for applied in reversed(redone):
            applied.undo(map)
        for applied in redone:
            state = new.pop(applied.index).state if applied.index in new else applied.state
            pending.open.append(
                self._fuse_state(state, applied.index, applied.ids, applied.turns, applied.similarities, map)
            )
        if redone:
            ctx.count("update_undone", len(updates) - len(new))
        return tuple(new.values()), [applied.ids for applied in redone]

    def _apply(self, update: MapUpdate, threshold: NoveltyThreshold | None, map: ViewMixtures) -> AppliedUpdate:
        view = update.view
        distances = view.distances(map.views) if len(map) and threshold else np.empty(0)
        rows = np.flatnonzero(distances < threshold.distance) if threshold else np.empty(0, np.int64)
        if threshold and len(rows):
            similarities, turns = similarity(distances[rows], threshold.distance), view.turns(map.views[rows])
        else:
            rows = np.array([map.add_view(view.values, type(view).__name__)])
            similarities, turns = np.ones(1), np.zeros(1)
        map.step()
        return self._fuse_state(update.state, update.index, map.ids[rows], turns, similarities, map)

    def _fuse_state(
        self, state: GaussianMixture, index: int, ids: Ints, turns: Array, similarities: Array, map: ViewMixtures
    ) -> AppliedUpdate:
        applied = record_update(state, index, ids, turns, similarities, map)
        mixtures = [
            fuse([places, parts(state, turn, s)], MERGE_BELOW, self.spread, MIN_WEIGHT, self.average)
            for places, turn, s in zip(applied.places(), turns.tolist(), similarities.tolist(), strict=True)
        ]
        owners = np.repeat(applied.rows(map), [len(weights) for _, _, weights, _ in mixtures])
        if mixtures:
            map.put_mixtures(owners, *(np.concatenate(fields) for fields in zip(*mixtures, strict=True)))
        return applied


def parts(state: GaussianMixture, turn: float, similarity: float) -> Parts:
    """A state as components of a view from which the robot is turned by `turn`, counter-clockwise: means, covariances,
    weights, and counts, which sum to `similarity`.
    """
    means = state.means.copy()
    means[:, 2] = wrap(means[:, 2] - turn)
    return means, state.covariances, state.weights, state.weights * similarity


def fuse(mixtures: list[Parts], merge_below: float, spread: bool, min_weight: float, average: Average) -> Parts:
    """Fuse mixtures with equal shares: merge close components, normalise the weights, drop weak components; the
    heaviest stays.
    """
    means, covariances, weights, counts = (np.concatenate(rows) for rows in zip(*mixtures, strict=True))
    if average == "visits":
        means, covariances, counts, weights = merged(means, covariances, counts, merge_below, spread, weights)
    else:
        means, covariances, weights, counts = merged(means, covariances, weights, merge_below, spread, counts)
    weights = weights / weights.sum()
    kept = weights >= min(min_weight, weights.max())
    weights = weights[kept] / weights[kept].sum()
    return means[kept], covariances[kept], weights, counts[kept]
