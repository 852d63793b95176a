"""Points of the plane by cells: which are near some places, at a cost that does not grow with their number."""

import math
from typing import NamedTuple

import numpy as np

from omninav.pipeline.engine.compiled import compiled
from omninav.stages.geometry.arrays import Array, Bools, Ints, Shorts

CELLS_PER_RADIUS = 4
ROWS = 1 << 31
"""Cell (i, j) has the number i * ROWS + j."""


class PointCells(NamedTuple):
    """Points (N, >= 2), in metres, sorted into cells `width` metres wide.

    The points of cell `numbers[c]` are `order[starts[c] : starts[c + 1]]`; `numbers` ascend. Cells without a point have
    no number.
    """

    points: Array
    width: float
    numbers: Ints
    starts: Ints
    order: Shorts


def sort_into_cells(points: Array, radius: float) -> PointCells:
    """Sort points (N, >= 2) into cells that suit questions about this radius (m), and others like it."""
    width = radius * (1.0 + math.sqrt(0.5) / CELLS_PER_RADIUS)
    numbers = _numbers(points, width)
    order = np.argsort(numbers, kind="stable")
    found, starts = np.unique(numbers[order], return_index=True)
    return PointCells(points, width, found, np.append(starts, len(points)), order.astype(np.int32))


def distinct(numbers: Ints) -> Ints:
    """Each of the numbers once, ascending. `numpy.unique` hashes them first, which takes ten times as long here."""
    ordered = np.sort(numbers, axis=None)
    return ordered[np.append(True, ordered[1:] != ordered[:-1])] if len(ordered) else ordered


def within(cells: PointCells, places: Array, radius: float) -> Ints:
    """The points within `radius` metres of any place (M, >= 2), and some up to 1.36 as far: ascending indices.

    The points of cells that are near are looked at, each against places rounded to a quarter of the radius.
    """
    if radius <= 0.0 or not len(places) or not len(cells.points):
        return np.empty(0, np.int64)
    cell = radius / CELLS_PER_RADIUS
    rounded = np.floor(places[:, :2] / cell).astype(np.int64)
    low = rounded.min(axis=0)
    height = int(rounded[:, 1].max() - low[1]) + 1
    numbers = distinct((rounded[:, 0] - low[0]) * height + rounded[:, 1] - low[1])
    # A place is within half a cell's diagonal of its cell's centre: the radius grows by that much.
    reach = CELLS_PER_RADIUS + math.sqrt(0.5)
    centres = (np.column_stack(np.divmod(numbers, height)) + low + 0.5) * cell
    near = _points_around(cells, centres, reach * cell)
    found: Bools = _near_places(cells.points[near, :2] / cell - low - 0.5, numbers, height, reach)
    return np.sort(near[found])


def have_a_point_within(cells: PointCells, places: Array, radius: float) -> Bools:
    """Which places (M, >= 2) are less than `radius` metres, at most the width of a cell, from any point: (M,)."""
    own = _numbers(places, cells.width)
    xy = np.ascontiguousarray(cells.points[cells.order, :2])
    return _near_point(np.ascontiguousarray(places[:, :2]), own, xy, *cells[2:4], radius)


@compiled(nogil=True)
def _near_point(places: Array, own: Ints, points: Array, numbers: Ints, starts: Ints, radius: float) -> Bools:
    found = np.zeros(len(places), np.bool_)
    for n in range(len(places)):
        for aside in range(-1, 2):  # the three cells of a column follow each other
            first = np.searchsorted(numbers, own[n] + aside * ROWS - 1)
            while first < len(numbers) and numbers[first] <= own[n] + aside * ROWS + 1 and not found[n]:
                for k in range(starts[first], starts[first + 1]):
                    x, y = places[n, 0] - points[k, 0], places[n, 1] - points[k, 1]
                    if x * x + y * y < radius * radius:
                        found[n] = True
                        break
                first += 1
    return found


def _numbers(points: Array, width: float) -> Ints:
    at = np.floor(points[:, :2] / width).astype(np.int64)
    return at[:, 0] * ROWS + at[:, 1]


def _points_around(cells: PointCells, centres: Array, radius: float) -> Ints:
    # The points of all cells that a square of `radius` around any centre touches.
    steps = np.arange(-math.ceil(radius / cells.width), math.ceil(radius / cells.width) + 1)
    own = distinct(_numbers(centres, cells.width))
    around = distinct(own[:, None, None] + steps[:, None] * ROWS + steps)
    at = np.searchsorted(cells.numbers, around)
    held = at[(at < len(cells.numbers)) & (cells.numbers[np.minimum(at, len(cells.numbers) - 1)] == around)]
    first, number = cells.starts[held], cells.starts[held + 1] - cells.starts[held]
    runs = np.repeat(first - np.cumsum(number) + number, number) + np.arange(number.sum())
    return np.asarray(cells.order[runs], np.int64)


@compiled(nogil=True)
def _near_places(points: Array, numbers: Ints, height: int, radius: float) -> Bools:
    # In units of cells; cell (i, j) has the number i * height + j, and `numbers` ascend.
    out, columns = np.zeros(len(points), np.bool_), numbers[-1] // height + 1
    for n in range(len(points)):
        x, y = points[n, 0], points[n, 1]
        for i in range(max(0, math.ceil(x - radius)), min(columns, math.floor(x + radius) + 1)):
            half = math.sqrt(max(0.0, radius * radius - (x - i) * (x - i)))
            first, last = max(0, math.ceil(y - half)), min(height - 1, math.floor(y + half))
            if first <= last:
                at = np.searchsorted(numbers, i * height + first)
                if at < len(numbers) and numbers[at] <= i * height + last:
                    out[n] = True
                    break
    return out
