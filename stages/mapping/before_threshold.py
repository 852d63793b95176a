"""Lessons that come before there is a limit that says which views are new."""

from collections.abc import Iterable
from dataclasses import field

from omninav.pipeline import State
from omninav.stages.values.map_update import MapUpdate
from omninav.stages.values.view_mixtures import ViewMixtures
from omninav.stages.values.views import NoveltyThreshold


class BeforeThreshold(State):
    """The lessons that wait until there is a limit, in the order in which they came."""

    waiting: list[MapUpdate] = field(default_factory=list)


def due(
    lessons: Iterable[MapUpdate], limit: NoveltyThreshold | None, map: ViewMixtures, before: BeforeThreshold
) -> list[MapUpdate]:
    """Take lessons in, and give those that can be learned now: without a limit a map's first one only, with one all."""
    before.waiting += lessons
    now = len(before.waiting) if limit is not None else 0 if len(map) else 1
    ready, before.waiting = before.waiting[:now], before.waiting[now:]
    return ready
