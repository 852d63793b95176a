"""Holds updates back until there is a novelty threshold, and begins a map again."""

from collections.abc import Iterable
from dataclasses import field

from omninav.pipeline import State
from omninav.stages.values.map_update import MapUpdate, MapUpdates
from omninav.stages.values.view_mixtures import ViewMixtures
from omninav.stages.values.views import NoveltyThreshold


class BeforeThreshold(State):
    """Updates that wait for a threshold, in their order."""

    waiting: list[MapUpdate] = field(default_factory=list)


def due(
    updates: Iterable[MapUpdate], threshold: NoveltyThreshold | None, map: ViewMixtures, before: BeforeThreshold
) -> list[MapUpdate]:
    """Queue updates, and return those that can be applied now: all with a threshold, else only a map's first."""
    before.waiting += updates
    now = len(before.waiting) if threshold is not None else 0 if len(map) else 1
    ready, before.waiting = before.waiting[:now], before.waiting[now:]
    return ready


def begin(updates: MapUpdates | None, map: ViewMixtures, before: BeforeThreshold) -> None:
    """Forget all where the updates say so, and keep the drives that they come with."""
    if updates is not None and updates.relearn:
        map.forget_all()
        before.waiting = []
    if updates is not None and updates.sessions is not None:
        map.put(sessions=updates.sessions)
