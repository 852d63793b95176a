"""Paths to a goal along a roadmap: points at which a robot has been, and what joins them."""

from typing import NamedTuple

import numpy as np

from omninav.stages.geometry.arrays import Array, Ints


class Paths(NamedTuple):
    """The shortest path from each of N points: `metres` (N,) to the goal, and the `next` point (N,), N for the goal."""

    metres: Array
    next: Ints


def paths_to(
    goal: Array, points: Array, edges: Ints, reach: float, extra: Array, between: Array | tuple[()] = ()
) -> Paths:
    """Shortest paths to a goal (2,) from points (N, 2) along `edges` (E, 2), and between points closer than `reach` m.

    The goal is joined with all points that are at most `reach` farther from it than the nearest one. `extra` (N,):
    metres by which a path through a point counts as longer, `between` (B, 3): places x, y and metres by which each
    stretch counts as longer that leads within `reach` of one. Dijkstra's algorithm.
    """
    from scipy.sparse import coo_matrix  # slow to import, and seldom needed
    from scipy.sparse.csgraph import dijkstra
    from scipy.spatial import KDTree

    count, gaps = len(points), np.hypot(*(points - goal).T)
    last = np.flatnonzero(gaps <= gaps.min() + reach)
    close = KDTree(points).query_pairs(reach, output_type="ndarray").astype(np.int64)
    pairs = np.concatenate([edges, close, np.column_stack([last, np.full(len(last), count)])])
    one, other = np.unique(np.sort(pairs, axis=1), axis=0).T
    places, more = np.vstack([points, goal]), np.append(extra, 0.0)
    metres = np.hypot(*(places[one] - places[other]).T) + (more[one] + more[other]) / 2.0
    steps = places[other] - places[one]
    for blocked in between:
        off = blocked[:2] - places[one]
        along = np.clip((off * steps).sum(axis=1) / np.maximum((steps**2).sum(axis=1), 1e-9), 0.0, 1.0)
        metres += blocked[2] * (np.hypot(*(off - along[:, None] * steps).T) <= reach)
    graph = coo_matrix((np.maximum(metres, 1e-6), (one, other)), shape=(count + 1, count + 1)).tocsr()
    lengths, before = dijkstra(graph, directed=False, indices=count, return_predecessors=True)
    return Paths(lengths[:count], before[:count].astype(np.int64))


def path_from(place: Array, points: Array, paths: Paths, reach: float, to_goal: float) -> Ints | None:
    """The points (K,) of the shortest path from a place (2,) that is `to_goal` m from the goal; None where none leads.

    It begins at a point that is at most `reach` m farther away than the nearest, or is empty where the goal is.
    """
    gaps = np.hypot(*(points - place).T)
    near = gaps.min() + reach
    if to_goal <= near:
        return np.zeros(0, np.int64)
    lengths = np.where(gaps <= near, gaps + paths.metres, np.inf)
    point = int(np.argmin(lengths))
    if not np.isfinite(lengths[point]):
        return None
    found = []
    while point < len(points):
        found.append(point)
        point = int(paths.next[point])
    return np.array(found, np.int64)


def ahead_on(line: Array, place: Array, ahead: float) -> tuple[Array, float]:
    """The point (2,) of a line (K, 2) `ahead` m on from its point closest to a place (2,), or its end.

    The closest point is looked for in the first `ahead` metres. And the metres of the line beyond the point that is
    given.
    """
    if len(line) == 1:
        return line[0], 0.0
    steps = np.diff(line, axis=0)
    lengths = np.maximum(np.hypot(*steps.T), 1e-9)
    begins = np.cumsum(lengths) - lengths
    along = np.clip(((place - line[:-1]) * steps).sum(axis=1) / lengths, 0.0, lengths)
    off = np.hypot(*(line[:-1] + steps * (along / lengths)[:, None] - place).T)
    closest = int(np.argmin(np.where(begins <= ahead, off, np.inf)))
    total = float(begins[-1] + lengths[-1])
    at = min(float(begins[closest] + along[closest]) + ahead, total)
    stops = np.append(begins, total)
    return np.array([np.interp(at, stops, axis) for axis in line.T]), total - at
