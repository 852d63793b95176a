"""Which picture of an album a robot was going to, tick by tick."""

from collections.abc import Sequence

import numpy as np

from omninav.pipeline import Context, Outputs, Stage
from omninav.stages.values.drive import Array
from omninav.stages.values.homing import PathProgress
from omninav.stages.values.image import Pixels
from omninav.stages.values.planned_route import PlannedRoute
from omninav.stages.values.thumbnails import Thumbnails, decoded
from omninav.stages.values.topological_map import TopologicalMap

from .homing_snapshot import HomingGlance


class FirstThumbnail(Stage):
    """An album of one: the first picture of a run, to which a robot that was carried away goes back."""

    class Out(Outputs):
        """`album`: absent where nothing was seen."""

        thumbnails: Thumbnails | None = None

    def step(self, ctx: Context, snapshots: Sequence[HomingGlance]) -> Out:
        """The whole run at once."""
        first = next(iter(snapshots), None)
        if first is None:
            return self.Out()
        return self.Out(
            thumbnails=Thumbnails(np.frombuffer(first.jpeg, np.uint8), np.array([0, len(first.jpeg)], np.int64))
        )


def target_view(progress: PathProgress | None, way: PlannedRoute | None, map: TopologicalMap | None) -> int | None:
    """The number of the view that the robot goes to: on a way over a map the map's, else the path's own; None: none."""
    if progress is None:
        return None
    at = min(progress.at, progress.of - 1)
    if map is None:
        return at
    if way is None or way.number != progress.path:
        return None
    views, _ = map.views_along(way.places)
    return int(views[at]) if at < len(views) else None


def target_of(
    progress: PathProgress | None,
    way: PlannedRoute | None,
    map: TopologicalMap | None,
    start: Array,
    album: Thumbnails | None,
) -> tuple[Array, Pixels | None]:
    """Where the view that the robot goes to was taken (3,), NaN where it is not known, and its picture.

    Without a map that is where the run began, `start` (3,).
    """
    view = target_view(progress, way, map)
    if view is None:
        return np.full(3, np.nan), None
    return start if map is None else map.poses[view], picture_of(view, album)


def picture_of(view: int | None, album: Thumbnails | None) -> Pixels | None:
    """A view's picture, where the album has it."""
    if view is None or album is None or view >= len(album) or album.ends[view] == album.ends[view + 1]:
        return None
    return decoded(album.jpegs[album.ends[view] : album.ends[view + 1]])
