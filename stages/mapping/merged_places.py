"""Places where two passes are side by side become one."""

import dataclasses
from typing import Annotated

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.geometry.appearance.place_clusters import medoids, renumbered
from omninav.stages.geometry.arrays import Array, Ints
from omninav.stages.values.compared_views import ComparedViews
from omninav.stages.values.topological_map import LoopHypotheses

MIN_SHARE = 0.4
"""Share of the features that match, for views of two passes to show one spot."""
NEIGHBOUR_VIEWS = 20.0
"""Views along the drive, on both passes together, within which an accepted hypothesis speaks for such a pair."""
MIN_GAP = 10
"""Views along the drive between two that are on different passes."""
NOTHING_IN_COMMON = 1.0
"""Distance along the drive of two views in turn that have nothing in common: larger than places are."""


class MergePlaces(Stage):
    """Merges places that are side by side, and gives each view to the place whose medoid is nearest along the drive.

    Goedemé et al. 2007, section 4.5, merge the subclusters of an accepted hypothesis. Where clusters of two passes
    begin and end at different points, some of each have no partner of the same cluster to be merged with, and stay as
    places of their own beside those of the other pass. Here distance is the sum of visual distances along the drive,
    which may change over to another pass wherever two views near an accepted hypothesis match; so views of both passes
    belong to one place, and places end where it is as far to the next.
    """

    min_spacing: Annotated[float, Bounds(ge=0)] = 0.1
    """Visual distance along the drive, of the medoids of two places that are not merged; 0: all stay as they are."""

    class Out(Outputs):
        hypotheses: LoopHypotheses

    def step(self, ctx: Context, views: ComparedViews, hypotheses: LoopHypotheses) -> Out:
        if not self.min_spacing:
            return self.Out(hypotheses=hypotheses)
        accepted = hypotheses.pairs[hypotheses.accepted]
        spots = same_spots(views.shares, views.orders, accepted, MIN_SHARE, NEIGHBOUR_VIEWS)
        row = np.arange(len(views) - 1)
        row = row[(views.tours[:-1] == views.tours[1:]) & (views.tours[:-1] > 0)]
        known = np.flatnonzero(views.owners >= 0)
        same = np.argwhere(np.triu(views.owners[known, None] == views.owners[known], 1))
        edges = np.concatenate([np.column_stack([row, row + 1]), accepted, spots, known[same]])
        place = merged_places(views.distances, edges, hypotheses.place, views.owners, self.min_spacing)
        return self.Out(hypotheses=dataclasses.replace(hypotheses, place=place))


def same_spots(shares: Array, orders: Ints, accepted: Ints, min_share: float, reach: float) -> Ints:
    """Pairs of views (K, 2) of different passes that show one spot.

    So many of their features match (`shares` (N, N)), and on both passes they are near an `accepted` pair (A, 2): the
    gaps along the drive (`orders` (N,)) are at most `reach` together. A pair that looks the same without such a
    neighbour may be elsewhere.
    """
    one, other = np.nonzero(np.triu(shares >= min_share, 1))
    apart = np.abs(orders[one] - orders[other]) >= MIN_GAP
    one, other = one[apart], other[apart]
    near = np.zeros(len(one), np.bool_)
    for first, second in accepted:
        straight = np.abs(orders[one] - orders[first]) + np.abs(orders[other] - orders[second])
        crossed = np.abs(orders[one] - orders[second]) + np.abs(orders[other] - orders[first])
        near |= np.minimum(straight, crossed) <= reach
    return np.column_stack([one[near], other[near]]).astype(np.int64)


def distances_along(distances: Array, edges: Ints, views: Ints) -> Array:
    """Least sum of visual distances from some views (M,) to all (N,) on a path over `edges` (E, 2): (M, N).

    inf where there is no way.
    """
    edges = np.unique(np.sort(edges, axis=1), axis=0)
    length = distances[edges[:, 0], edges[:, 1]]
    length = np.clip(np.where(np.isfinite(length), length, NOTHING_IN_COMMON), 1e-9, NOTHING_IN_COMMON)
    graph = coo_matrix((length, (edges[:, 0], edges[:, 1])), shape=distances.shape).tocsr()
    return np.asarray(dijkstra(graph, directed=False, indices=views), np.float64)


def merged_places(distances: Array, edges: Ints, place: Ints, known: Ints, min_spacing: float) -> Ints:
    """Places (N,) of which no two are side by side, numbered in the order of the views.

    Of places (`place` (N,)) whose medoids are at most `min_spacing` apart along `edges` (E, 2) the one with more views
    stays. Each view then belongs to the nearest medoid. `known` (N,): views of a known map, all of whose places stay,
    with their views; -1: a new view.
    """
    middle, size = medoids(distances, place), np.bincount(place)
    lasting = np.isin(np.arange(len(middle)), place[known >= 0])
    between = distances_along(distances, edges, middle)
    kept: list[int] = []
    for number in np.lexsort((np.arange(len(middle)), -size, ~lasting)):
        if lasting[number] or (between[number, middle[kept]] > min_spacing).all():
            kept.append(int(number))
    kept.sort()
    nearest = np.array(kept, np.int64)[between[kept].argmin(axis=0)]
    return renumbered(np.where(known >= 0, place, nearest))
