"""A grid of what ranges have shown around a robot, and ways through it.

Grids are (CELLS, CELLS), rows along y, columns along x, with the frame's origin in the middle.
"""

from typing import NamedTuple

import cv2
import numpy as np

from omninav.stages.geometry.arrays import Array, Bools, Ints

CELLS, CELL_M = 120, 0.1
"""Cells along a side of the grid, and their width, metres."""
HIT, MISS, MOST = 0.8, 0.4, 3.0
"""Log odds of an obstacle that an echo adds and that a free beam takes away, and the largest amount of either."""
SEEN = 1e-9
"""Log odds of a cell in which echoes and free beams cancel: 0 is kept for those of which nothing is known."""
CLOSE_M = 0.15
"""Distance from an obstacle in which a way is dearer, on top of the robot's radius, metres."""
OCCUPIED_COST, CLOSE_COST, UNKNOWN_COST = 20.0, 3.0, 1.5
"""Price of a metre where the robot has no room, little room, and where nothing is known, over one of free space. None
is infinite: a wide beam closes a door that is open."""

_INDEX = np.arange(CELLS * CELLS).reshape(CELLS, CELLS)
_NEIGHBOURS = (
    (_INDEX[:, :-1], _INDEX[:, 1:], CELL_M),
    (_INDEX[:-1], _INDEX[1:], CELL_M),
    (_INDEX[:-1, :-1], _INDEX[1:, 1:], CELL_M * 2.0**0.5),
    (_INDEX[1:, :-1], _INDEX[:-1, 1:], CELL_M * 2.0**0.5),
)
_ONE = np.concatenate([one.ravel() for one, _, _ in _NEIGHBOURS])
_OTHER = np.concatenate([other.ravel() for _, other, _ in _NEIGHBOURS])
_STEP = np.concatenate([np.full(one.size, step) for one, _, step in _NEIGHBOURS])
_MIDDLES = CELL_M * (np.arange(CELLS) - CELLS / 2 + 0.5)


class Ways(NamedTuple):
    """The cheapest ways from one cell to all: prices (m) and the cell before, both (CELLS * CELLS,), of flat cells."""

    price: Array
    before: Ints


def marked(evidence: Array, pose: Array, ranges: Array, azimuths: Array, farthest: float) -> Array:
    """Log odds of an obstacle (CELLS, CELLS) after a ring of ranges (N,), inf without an echo, from a pose (3,).

    Each cell takes the beam nearest to its direction, if there is one (Moravec & Elfes 1985, with one beam to a
    sector). An echo counts less, the wider its beam is there.
    """
    x, y = _MIDDLES[None, :] - pose[0], _MIDDLES[:, None] - pose[1]
    away = np.hypot(x, y)
    step = float(azimuths[1] - azimuths[0])
    width = abs(step)
    turn = np.mod(np.sign(step) * (np.arctan2(y, x) - pose[2] - azimuths[0]), 2.0 * np.pi)
    beam = np.rint(turn / width).astype(np.int64)
    beam[beam >= round(2.0 * np.pi / width)] = 0
    seen = np.where(beam < len(ranges), ranges[np.minimum(beam, len(ranges) - 1)], np.nan)
    echo = np.abs(away - seen) <= CELL_M
    free = away < np.minimum(seen, farthest) - CELL_M
    told = HIT * np.minimum(1.0, 2.0 * CELL_M / np.maximum(away * width, CELL_M)) * echo - MISS * free
    added: Array = np.clip(evidence + told, -MOST, MOST)
    cancelled = (added == 0.0) & (told != 0.0)
    added[cancelled] = np.copysign(SEEN, told[cancelled])
    return added


def shifted(evidence: Array, rows: int, columns: int) -> Array:
    """The grid with what was `rows`, `columns` farther on in each cell, and nothing where that was outside."""
    moved = np.zeros_like(evidence)
    to = tuple(slice(max(0, -n), max(0, CELLS - max(0, n))) for n in (rows, columns))
    of = tuple(slice(max(0, n), max(0, CELLS - max(0, -n))) for n in (rows, columns))
    moved[to] = evidence[of]
    return moved


def prices(evidence: Array, radius: float) -> Array:
    """Gives the price of a metre through each cell for a disc of `radius` m: (CELLS, CELLS), 1 in free space."""
    gap = CELL_M * cv2.distanceTransform((evidence <= 0.0).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    if not (evidence > 0.0).any():
        gap = np.full_like(evidence, np.inf)
    cost = np.where(evidence < 0.0, 1.0, UNKNOWN_COST)
    cost[gap <= radius + CLOSE_M] = CLOSE_COST
    cost[gap <= radius] = OCCUPIED_COST
    return cost


def cell_at(point: Array) -> int:
    """The flat cell in which a point (2,) is, or the nearest one to it."""
    column, row = np.clip(np.floor(point / CELL_M + CELLS / 2), 0, CELLS - 1).astype(np.int64)
    return int(row * CELLS + column)


def on_grid(points: Array) -> Bools:
    """Tells which of some points (N, 2) are on the grid: (N,)."""
    return np.asarray(np.all(np.abs(points) < CELL_M * CELLS / 2, axis=1))


def points_of(cells: Ints) -> Array:
    """The middles (N, 2) of flat cells (N,)."""
    return np.column_stack([_MIDDLES[cells % CELLS], _MIDDLES[cells // CELLS]])


def ways_from(cell: int, cost: Array) -> Ways:
    """The cheapest ways from a cell over its eight neighbours, and theirs: Dijkstra's algorithm."""
    from scipy.sparse import csr_matrix  # slow to import, and seldom needed
    from scipy.sparse.csgraph import dijkstra

    flat = cost.ravel()
    metres = _STEP * (flat[_ONE] + flat[_OTHER]) / 2.0
    graph = csr_matrix((metres, (_ONE, _OTHER)), shape=(flat.size, flat.size))
    price, before = dijkstra(graph, directed=False, indices=cell, return_predecessors=True)
    return Ways(price, before.astype(np.int64))


def way_to(cell: int, ways: Ways) -> Array:
    """The points (K, 2) of the cheapest way to a cell, which is the last."""
    found = [cell]
    while ways.before[found[-1]] >= 0:
        found.append(int(ways.before[found[-1]]))
    return points_of(np.array(found[::-1], np.int64))


def frontier(evidence: Array, cost: Array) -> Ints:
    """Flat cells of free space where a robot has room, beside some that nothing is known of (Yamauchi 1997)."""
    beside = cv2.dilate((evidence == 0.0).astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    return np.flatnonzero(beside & (evidence < 0.0) & (cost < OCCUPIED_COST)).astype(np.int64)
