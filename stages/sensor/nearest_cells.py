"""Looks up the nearest of some fixed points in cells of the plane."""

import math
from typing import Any

import numpy as np

from omninav.pipeline.engine.compiled import compiled
from omninav.stages.geometry.arrays import Array, Ints, Shorts

MAX_CELLS = 1 << 26
"""Cells over an area; a huge one has larger cells."""
FEW_POINTS = 1000
"""Points up to which all of them are looked at for each cell, which takes less time than a search in a tree."""
TIE = 1e-9
"""Relative difference of squared distances below which the tree decides which comes first."""
_NO_POINTS = np.zeros((0, 2))


class NearestCells:
    """For places in a plane, the k points (N, >= 2) nearest to the centres of their cells, within `radius` (m).

    `cell`: width of a cell (m), from the corner `origin` (2,) on. A cell's list is made when the first place falls into
    it, so that neither time nor memory grows with the area.
    """

    def __init__(self, points: Array, k: int, cell: float, radius: float) -> None:
        from scipy.spatial import KDTree  # slow to import: not before a run

        xy = np.ascontiguousarray(points[:, :2], np.float64)
        self.k, self.radius = k, radius
        self.origin, self.cell, self._columns, self._rows = np.zeros(2), cell, 0, 0
        if len(xy):
            self.origin = xy.min(axis=0) - radius
            span = xy.max(axis=0) + radius - self.origin
            self.cell = max(cell, float(np.sqrt(span[0] * span[1] / MAX_CELLS)))
            self._columns, self._rows = (int(n) for n in np.floor(span / self.cell) + 1)
        self._tree: Any = KDTree(xy)
        self._numbers = np.zeros(self._columns * self._rows, np.int32)  # memory is taken where it is written
        self._lists, self._known = np.full((1, k), -1, np.int32), 1

    def of(self, poses: Array) -> Shorts:
        """The points nearest to the cell of each pose (M, >= 2): (M, k), nearest first, then -1."""
        poses = np.ascontiguousarray(poses, np.float64)
        if self._known + len(poses) > len(self._lists):
            more = np.empty((len(self._lists) + len(poses), self.k), np.int32)
            self._lists = np.concatenate([self._lists[: self._known], more])
        found, new = np.empty((len(poses), self.k), np.int32), np.empty(len(poses), np.int64)
        few = self._tree.n <= FEW_POINTS
        given = poses, self._tree.data if few else _NO_POINTS, self.origin, self.cell, self._columns, self._rows
        number, sure = _look_up(*given, self.radius, self._numbers, self._lists, self._known, found, new)
        if number and not (few and sure):
            centres = self.origin + self.cell * (np.column_stack(np.divmod(new[:number], self._rows)) + 0.5)
            nearest = self._in_tree(centres)
            self._lists[self._known : self._known + number] = np.where(nearest < self._tree.n, nearest, -1)
            _look_up(*given, self.radius, self._numbers, self._lists, self._known, found, new)
        self._known += number
        return found

    def _in_tree(self, centres: Array) -> Ints:
        """The points nearest to centres (M, 2): (M, k), nearest first, then the number of points."""
        found: Ints = self._tree.query(centres, k=[*range(1, self.k + 1)], distance_upper_bound=self.radius)[1]
        return found


@compiled(nogil=True)
def _look_up(
    poses: Array,
    points: Array,
    origin: Array,
    cell: float,
    columns: int,
    rows: int,
    radius: float,
    numbers: Shorts,
    lists: Shorts,
    known: int,
    found: Shorts,
    new: Ints,
) -> tuple[int, bool]:
    # The list of each pose's cell; list 0 is empty. Cells without a list get the numbers from `known` on, and lists of
    # these points, which the tree has to make where distances are too equal to decide which comes first.
    number, sure, per_cell = 0, True, 1.0 / cell
    empty, nearest, squares = lists[0], np.empty(lists.shape[1] + 1, np.int64), np.empty(lists.shape[1] + 1)
    for n in range(len(poses)):
        i = math.floor((poses[n, 0] - origin[0]) * per_cell)
        j = math.floor((poses[n, 1] - origin[1]) * per_cell)
        row = empty
        if 0 <= i < columns and 0 <= j < rows:
            at = numbers[i * rows + j]
            if at == 0:
                at = known + number
                numbers[i * rows + j], new[number] = at, i * rows + j
                number += 1
                x, y = origin[0] + cell * (i + 0.5), origin[1] + cell * (j + 0.5)
                sure = _nearest_of_few(x, y, points, radius, nearest, squares, lists[at]) and sure
            row = lists[at]
        for k in range(len(row)):
            found[n, k] = row[k]
    return number, sure


@compiled(nogil=True)
def _nearest_of_few(
    x: float, y: float, points: Array, radius: float, nearest: Ints, squares: Array, found: Shorts
) -> bool:
    # As the tree's search gives them; False where distances are too equal to decide which comes first.
    number, k, limit, sure = 0, len(found), radius * radius, True
    for n in range(len(points)):
        dx, dy = points[n, 0] - x, points[n, 1] - y
        square = dx * dx + dy * dy
        if abs(square - limit) <= TIE * limit:
            sure = False
        if square >= limit or (number > k and square >= squares[k]):
            continue
        at = number if number <= k else k
        while at > 0 and squares[at - 1] > square:
            nearest[at], squares[at] = nearest[at - 1], squares[at - 1]
            at -= 1
        nearest[at], squares[at] = n, square
        number = min(number + 1, k + 1)
    for at in range(1, number):
        if squares[at] - squares[at - 1] <= TIE * squares[at]:
            sure = False
    for at in range(k):
        found[at] = nearest[at] if at < number else -1
    return sure
