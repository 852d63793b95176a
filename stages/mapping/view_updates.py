"""Updates of a map of views: those that wait, those that start it over, and what changed in a tick."""

from collections.abc import Iterable, Mapping
from dataclasses import field
from typing import Literal

import numpy as np

from omninav.pipeline import State
from omninav.stages.geometry.arrays import Bools, Ints
from omninav.stages.values.map_update import MapUpdate, MapUpdates
from omninav.stages.values.view_mixtures import ViewEvent, ViewMixtures
from omninav.stages.values.views import NoveltyThreshold


class PendingUpdates(State):
    """Updates that wait for a threshold, in their order."""

    waiting: list[MapUpdate] = field(default_factory=list)


def ready_updates(
    updates: Iterable[MapUpdate], threshold: NoveltyThreshold | None, map: ViewMixtures, pending: PendingUpdates
) -> list[MapUpdate]:
    """Queue updates, and return those that can be applied now: all with a threshold, else only a map's first."""
    pending.waiting += updates
    now = len(pending.waiting) if threshold is not None else 0 if len(map) else 1
    ready, pending.waiting = pending.waiting[:now], pending.waiting[now:]
    return ready


def start_over(updates: MapUpdates | None, map: ViewMixtures, pending: PendingUpdates) -> None:
    """Forget all where the updates state it, and keep the drives that they come with."""
    if updates is not None and updates.relearn:
        map.forget_all()
        pending.waiting = []
    if updates is not None and updates.sessions is not None:
        map.put(sessions=updates.sessions)


def within_cap(map: ViewMixtures, max_views: int) -> Bools:
    """Which views (R,) stay in a map of at most `max_views`; 0: all of them.

    The weakest go first: those with the smallest sum of weights, then the fewest observations, then the oldest. Views
    inserted in the map's current step go last, since they could gain no weight yet.
    """
    surplus = len(map) - max_views
    kept = np.ones(len(map), np.bool_)
    if max_views and surplus > 0:
        weight = np.bincount(map.owner, map.weights, len(map))
        count = np.bincount(map.owner, map.counts, len(map))
        new = map.born >= map.steps
        kept[np.lexsort((map.ids, count, weight, new))[:surplus]] = False
    return kept


def view_event(
    map: ViewMixtures,
    ids_before: Ints,
    changed: Ints,
    seen: Mapping[int, int],
    why: Literal["", "forgotten", "merged", "full"] = "",
) -> ViewEvent:
    """The event of a tick: views inserted and removed since the map had `ids_before` (R0,), and the changed ones.

    `changed`: ids (any order, repeated or not) of views whose mixtures changed; removed ones are left out. `seen`: for
    each id given since then, the tick in which the view was seen. `why`: the reason of removals.
    """
    removed = np.setdiff1d(ids_before, map.ids, assume_unique=True)
    inserted = np.setdiff1d(map.ids, ids_before, assume_unique=True)
    ids, rows, _ = np.intersect1d(map.ids, changed, return_indices=True)
    weights, places, parts = np.zeros(len(rows)), np.zeros((len(rows), 2)), np.zeros(len(rows), np.int64)
    if len(rows) and len(map.owner):
        by_owner = np.lexsort((map.weights, map.owner))  # each view's heaviest component comes last
        end = np.searchsorted(map.owner[by_owner], rows, side="right")
        parts = end - np.searchsorted(map.owner[by_owner], rows, side="left")
        heaviest = by_owner[np.maximum(end - 1, 0)]
        weights = np.where(parts > 0, map.weights[heaviest], 0.0)
        places = np.where(parts[:, None] > 0, map.means[heaviest, :2], 0.0)
    return ViewEvent(
        views=len(map),
        components=len(map.weights),
        inserted=inserted,
        seen=np.array([seen[name] for name in inserted.tolist()], np.int64),
        removed=removed,
        why=why if len(removed) else "",
        changed=ids,
        weights=weights,
        places=places,
        parts=parts.astype(np.int64),
    )
