"""Places along a drive, by visual distance alone: clusters, their parts along the drive, and their medoids."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.cluster.hierarchy import fcluster, linkage
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial.distance import squareform

from omninav.stages.geometry.arrays import Array, Ints


def renumbered(labels: npt.ArrayLike) -> Ints:
    """The same groups (N,), numbered from 0 in the order in which they first come."""
    labels = np.asarray(labels)
    _, first, inverse = np.unique(labels, return_index=True, return_inverse=True)
    order = np.argsort(np.argsort(first, kind="stable"), kind="stable")
    return np.asarray(order[inverse.reshape(-1)], np.int64)


def complete_linkage(distances: Array, size: float) -> Ints:
    """Clusters (N,) in which no two views are further apart than `size` (Goedemé et al. 2007, section 4.4.1).

    `distances` (N, N) symmetric, inf where two views have nothing in common. Numbered in the order of the views.
    """
    if len(distances) < 2:
        return np.zeros(len(distances), np.int64)
    finite = distances[np.isfinite(distances)]
    beyond = 2.0 * max(float(finite.max(initial=0.0)), size) + 1.0
    between = squareform(np.where(np.isfinite(distances), distances, beyond), checks=False)
    return renumbered(fcluster(linkage(between, "complete"), size, "distance"))


def groups(number: int, pairs: Ints) -> Ints:
    """Connected components (number,) of the graph with edges `pairs` (M, 2), numbered in order."""
    ones = np.ones(len(pairs))
    graph: Any = coo_matrix((ones, (pairs[:, 0], pairs[:, 1])), shape=(number, number))
    return renumbered(connected_components(graph, directed=False)[1])


def subclusters(cluster: Ints, tour: Ints) -> Ints:
    """Parts (N,) of clusters that the drive passed through without leaving them (section 4.4.2), in the drive's order.

    `tour` (N,): views of different tours were not driven one after the other.
    """
    first = np.flatnonzero((cluster[:-1] == cluster[1:]) & (tour[:-1] == tour[1:]))
    return groups(len(cluster), np.column_stack([first, first + 1]))


def medoid(distances: Array, rows: Ints) -> int:
    """The view with the least sum of distances to the others, the first of several."""
    gaps = np.minimum(distances[np.ix_(rows, rows)], 1e6)  # views of one place need not have anything in common
    return int(rows[np.argmin(gaps.sum(axis=1))])


def medoids(distances: Array, labels: Ints) -> Ints:
    """The medoid of each group of views: (G,)."""
    return np.array([medoid(distances, np.flatnonzero(labels == label)) for label in range(int(labels.max()) + 1)])


def nearest_views(distances: Array, subcluster: Ints, pairs: Ints) -> Ints:
    """Closest two views, one of each, of each two subclusters (H, 2): (H, 2)."""
    members = [np.flatnonzero(subcluster == number) for number in range(int(subcluster.max()) + 1)]
    nearest = np.empty((len(pairs), 2), np.int64)
    for row, (one, other) in enumerate(pairs):
        between = distances[np.ix_(members[one], members[other])]
        first, second = np.unravel_index(int(between.argmin()), between.shape)
        nearest[row] = members[one][first], members[other][second]
    return nearest


def rms_within(distances: Array, labels: Ints) -> float:
    """Root mean square of the finite distances within groups; 1 without any."""
    inside = distances[np.triu(labels[:, None] == labels[None], 1)]
    inside = inside[np.isfinite(inside)]
    spread = math.sqrt(float(np.mean(inside**2))) if len(inside) else 0.0
    return spread if spread > 0.0 else 1.0


def hypotheses(cluster: Ints, subcluster: Ints) -> Ints:
    """Every pair (H, 2) of subclusters of one cluster, which may be one place (section 4.4.2)."""
    of = cluster[np.unique(subcluster, return_index=True)[1]]
    return np.argwhere(np.triu(of[:, None] == of, 1))


def between_hypotheses(medoids: Ints, frames: Ints) -> Array:
    """Distances (H, H) between hypotheses, d_H of equation 8: the sum of their views', in views of the drive.

    `medoids` (H, 2): views; `frames` (N,): their numbers along the drive. Views are paired in the order that is nearer.
    """
    at = frames[medoids].astype(np.float64)
    gaps = np.abs(at[:, None, :, None] - at[None, :, None, :])  # (H, H, 2, 2)
    return np.asarray(np.minimum(gaps[..., 0, 0] + gaps[..., 1, 1], gaps[..., 0, 1] + gaps[..., 1, 0]))


def waypoint_views(matches: Callable[[int, int], int], path: Ints, min_matches: int, max_step: int) -> Ints:
    """The fewest views of a path along it, each with `min_matches` with the one before, where that is possible.

    `matches`: of one view with another one further along. `path`: views in the order of the drive; the first and the
    last are given and are not part of the answer. No two are more than `max_step` views apart, however similar: along
    a wall that repeats itself similarity shows nothing.
    """
    views = path.tolist()
    chosen: list[int] = []
    at = 0
    while at < len(views) - 1:
        ahead = range(min(at + max_step, len(views) - 1), at, -1)
        at = next((view for view in ahead if matches(views[at], views[view]) >= min_matches), at + 1)
        if at < len(views) - 1:
            chosen.append(views[at])
    return np.array(chosen, np.int64)
