"""The map's views that look like the present one."""

import math
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.geometry.appearance.view_similarity import Shape, similarity
from omninav.stages.values.view_mixtures import ViewMixtures
from omninav.stages.values.views import Neighbours, NoveltyThreshold, WholeView


class ViewNeighbours(Stage):
    """The views of the map within the limit of the present one, with a similarity that falls to 0 there.

    Porta & Kröse 2004, equations 4 and 5 (lambda); Gross, Koenig & Müller 2005, section 2.2 (S, whose shape is not
    given: erratum 12a). `shape` of S over distance: linear, quadratic (1 - d²/E²), cosine, or step (1 up to the limit).
    `count` 0: all of them; else the nearest `count` of the whole map, limit or none, as in section 2 of the former: S
    then falls to 0 at the one that follows them. Before there is a limit there are no neighbours.
    Raises BadInput where the map's views are not of this kind.
    """

    shape: Shape = "linear"
    count: Annotated[int, Bounds(ge=0)] = 0

    class Out(Outputs):
        """Who is near."""

        neighbours: Neighbours

    def step(self, ctx: Context, view: WholeView, map: ViewMixtures, threshold: NoveltyThreshold | None = None) -> Out:
        """Look through the map."""
        map.check_kind(view)
        if not len(map):
            none = np.zeros(0)
            return self.Out(neighbours=Neighbours(np.zeros(0, np.int64), none, none, none, np.inf))
        distances = view.distances(map.views)
        nearest = float(distances.min())
        if self.count:
            order = np.argsort(distances, kind="stable")
            rows = order[: self.count]
            within = float(distances[order[min(self.count, len(order) - 1)]]) if len(order) > 1 else math.inf
        else:
            within = 0.0 if threshold is None else threshold.distance
            rows = np.flatnonzero(distances < within)
            rows = rows[np.argsort(distances[rows], kind="stable")]
        near = distances[rows]
        turns = view.turns(map.views[rows]) if len(rows) else np.zeros(0)
        return self.Out(neighbours=Neighbours(rows, near, similarity(near, within, self.shape), turns, nearest))
