"""Holds updates back until there is a novelty threshold."""

from collections.abc import Iterable
from dataclasses import field

from omninav.pipeline import State
from omninav.stages.values.map_update import MapUpdate
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
