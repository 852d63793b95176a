"""Places that stand side by side become one: distances along the drive and across its loops."""

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from omninav.stages.geometry.appearance.place_clusters import medoids, renumbered
from omninav.stages.geometry.arrays import Array, Ints

MIN_GAP = 10
"""Views along the drive between two that are on different passes."""
NOTHING_IN_COMMON = 1.0
"""Distance along the drive of two views in turn that have nothing in common: larger than places are."""


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
