"""Finds the map's views that look like the current one."""

import math
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.geometry.appearance.view_similarity import similarity
from omninav.stages.values.view_mixtures import ViewMixtures
from omninav.stages.values.views import Neighbours, NoveltyThreshold, WholeView


class ViewNeighbours(Stage):
    """Finds the views of the map within the novelty threshold of the current one, with their similarities.

    Similarity is 1 at distance 0 and falls to 0 at the threshold: lambda of Porta & Kröse 2004, equations 4 and 5; S of
    Gross, Koenig & Müller 2005, section 2.2 (its shape is not given: erratum 12a in docs/papers.md). Without a
    threshold or a map there are no neighbours. Raises BadInput where the map's views are of another kind.
    """

    count: Annotated[int, Bounds(ge=0)] = 0
    """The nearest views to take, whatever the threshold (section 2 of the former): similarity then falls to 0 at the
    next view. 0: all views within the threshold."""

    class Out(Outputs):
        neighbours: Neighbours

    def step(self, ctx: Context, view: WholeView, map: ViewMixtures, threshold: NoveltyThreshold | None = None) -> Out:
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
        return self.Out(neighbours=Neighbours(rows, near, similarity(near, within), turns, nearest))
