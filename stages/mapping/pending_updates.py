"""Queues map updates until there is a novelty threshold, and starts a map over."""

from collections.abc import Iterable
from dataclasses import field

from omninav.pipeline import State
from omninav.stages.values.map_update import MapUpdate, MapUpdates
from omninav.stages.values.view_mixtures import ViewMixtures
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
    """Forget all where the updates say so, and keep the drives that they come with."""
    if updates is not None and updates.relearn:
        map.forget_all()
        pending.waiting = []
    if updates is not None and updates.sessions is not None:
        map.put(sessions=updates.sessions)
