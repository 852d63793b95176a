"""Looks up the nearest of some fixed points in cells of the plane."""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from omninav.pipeline.engine.compiled import compiled

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Shorts = npt.NDArray[np.int32]

MAX_CELLS = 1 << 26
"""Cells over an area; a huge one has larger cells."""
FEW_POINTS = 1000
"""Points up to which all of them are looked at for each cell, which takes less time than a search in a tree."""
TIE = 1e-9
"""Relative difference of squared distances below which the tree decides which comes first."""


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
        self._lists, self._known = np.full((64, k), -1, np.int32), 1

    def of(self, poses: Array) -> Shorts:
        """The points nearest to the cell of each pose (M, >= 2): (M, k), nearest first, then -1."""
        poses = np.ascontiguousarray(poses, np.float64)
        cells = self.origin, self.cell, self._columns, self._rows, self._numbers
        new = _new_cells(poses, *cells, self._known)
        if len(new):
            centres = self.origin + self.cell * (np.column_stack(np.divmod(new, self._rows)) + 0.5)
            found = self._nearest(centres)
            known = self._known + len(new)
            if known > len(self._lists):
                self._lists = np.concatenate([self._lists, np.full((known, self.k), -1, np.int32)])
            self._lists[self._known : known] = np.where(found < self._tree.n, found, -1)
            self._known = known
        lists: Shorts = self._lists[_numbers_of(poses, *cells)]
        return lists

    def _nearest(self, centres: Array) -> Ints:
        """The points nearest to centres (M, 2): (M, k), nearest first, then the number of points."""
        number = self._tree.n
        if not number or number > FEW_POINTS:
            return self._in_tree(centres)
        found, ties = _nearest_of_few(centres, self._tree.data, self.k, self.radius)
        if ties.any():
            found[ties] = self._in_tree(centres[ties])
        return found

    def _in_tree(self, centres: Array) -> Ints:
        found: Ints = self._tree.query(centres, k=[*range(1, self.k + 1)], distance_upper_bound=self.radius)[1]
        return found


@compiled(nogil=True)
def _new_cells(poses: Array, origin: Array, cell: float, columns: int, rows: int, numbers: Shorts, known: int) -> Ints:
    # The cells without a list in which poses are, each once; they get the numbers from `known` on.
    found, number, per_cell = np.empty(len(poses), np.int64), 0, 1.0 / cell
    for n in range(len(poses)):
        i = math.floor((poses[n, 0] - origin[0]) * per_cell)
        j = math.floor((poses[n, 1] - origin[1]) * per_cell)
        if 0 <= i < columns and 0 <= j < rows and numbers[i * rows + j] == 0:
            numbers[i * rows + j] = known + number
            found[number] = i * rows + j
            number += 1
    return found[:number].copy()


@compiled(nogil=True)
def _numbers_of(poses: Array, origin: Array, cell: float, columns: int, rows: int, numbers: Shorts) -> Shorts:
    # The number of the list of each pose's cell; list 0 is empty.
    found, per_cell = np.zeros(len(poses), np.int32), 1.0 / cell
    for n in range(len(poses)):
        i = math.floor((poses[n, 0] - origin[0]) * per_cell)
        j = math.floor((poses[n, 1] - origin[1]) * per_cell)
        if 0 <= i < columns and 0 <= j < rows:
            found[n] = numbers[i * rows + j]
    return found


@compiled(nogil=True)
def _nearest_of_few(centres: Array, points: Array, k: int, radius: float) -> tuple[Ints, npt.NDArray[np.bool_]]:
    # As the tree's search gives them, and for which centres distances are too equal to say which comes first.
    found, ties = np.full((len(centres), k), len(points), np.int64), np.zeros(len(centres), np.bool_)
    nearest, squares = np.empty(k + 1, np.int64), np.empty(k + 1)
    limit = radius * radius
    for m in range(len(centres)):
        number = 0
        for n in range(len(points)):
            x, y = points[n, 0] - centres[m, 0], points[n, 1] - centres[m, 1]
            square = x * x + y * y
            if abs(square - limit) <= TIE * limit:
                ties[m] = True
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
                ties[m] = True
        for at in range(min(number, k)):
            found[m, at] = nearest[at]
    return found, ties
