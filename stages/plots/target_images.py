"""The image of the view that a robot was going to, tick by tick."""

from collections.abc import Sequence

import numpy as np

from omninav.pipeline import Context, Outputs, Stage
from omninav.stages.geometry.arrays import Array
from omninav.stages.values.homing import PathProgress
from omninav.stages.values.image import Pixels
from omninav.stages.values.planned_route import PlannedRoute
from omninav.stages.values.thumbnails import Thumbnails
from omninav.stages.values.topological_map import TopologicalMap

from .homing_snapshot import EncodedHomingView
from .thumbnails import joined


class FirstThumbnail(Stage):
    """Keeps the first image of a run, to which a kidnapped robot returns, as the only thumbnail."""

    class Out(Outputs):
        """`thumbnails`: absent where nothing was seen."""

        thumbnails: Thumbnails | None = None

    def step(self, ctx: Context, snapshots: Sequence[EncodedHomingView]) -> Out:
        return self.Out(thumbnails=joined([snapshots[0].jpeg]) if snapshots else None)


def target_view(progress: PathProgress | None, route: PlannedRoute | None, map: TopologicalMap | None) -> int | None:
    """The number of the view that the robot goes to: the map's on a route over a map, else the path's; or None."""
    if progress is None:
        return None
    at = min(progress.at, progress.of - 1)
    if map is None:
        return at
    if route is None or route.number != progress.path:
        return None
    views, _ = map.views_along(route.places)
    return int(views[at]) if at < len(views) else None


def target_of(
    progress: PathProgress | None,
    route: PlannedRoute | None,
    map: TopologicalMap | None,
    start: Array,
    thumbnails: Thumbnails | None,
) -> tuple[Array, Pixels | None]:
    """Place (3,) of the view that the robot goes to, NaN where it is not known, and its image.

    Without a map that is where the run began, `start` (3,).
    """
    view = target_view(progress, route, map)
    if view is None:
        return np.full(3, np.nan), None
    return start if map is None else map.poses[view], image_of(view, thumbnails)


def image_of(view: int | None, thumbnails: Thumbnails | None) -> Pixels | None:
    """A view's image, where there is a thumbnail of it."""
    if view is None or thumbnails is None or view >= len(thumbnails) or not np.diff(thumbnails.ends)[view]:
        return None
    return thumbnails.image(view)
