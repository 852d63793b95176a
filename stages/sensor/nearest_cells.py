"""Looks up the nearest of some fixed points in cells of the plane."""

from typing import Any

import numpy as np

from omninav.stages.geometry.arrays import Array, Ints, Shorts
from omninav.stages.geometry.plane.point_cells import distinct

MAX_CELLS = 1 << 26
"""Cells over an area; a huge one has larger cells."""


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
        self._lists, self._known = np.full((1, k), -1, np.int32), 1  # list 0: of a cell that is not known yet

    def of(self, poses: Array) -> Shorts:
        """The points nearest to the cell of each pose (M, >= 2): (M, k), nearest first, then -1."""
        column, row = np.floor((poses[:, :2] - self.origin) * (1.0 / self.cell)).astype(np.int64).T
        inside = (column >= 0) & (column < self._columns) & (row >= 0) & (row < self._rows)
        cells = column[inside] * self._rows + row[inside]
        new = distinct(cells[self._numbers[cells] == 0])
        if len(new):
            self._add(new)
        found = np.full((len(poses), self.k), -1, np.int32)
        found[inside] = self._lists[self._numbers[cells]]
        return found

    def _add(self, cells: Ints) -> None:
        """Make the lists of cells, given by their numbers (C,)."""
        centres = self.origin + self.cell * (np.column_stack(np.divmod(cells, self._rows)) + 0.5)
        nearest = self._tree.query(centres, k=[*range(1, self.k + 1)], distance_upper_bound=self.radius)[1]
        known, self._known = self._known, self._known + len(cells)
        if self._known > len(self._lists):
            room = np.empty((len(self._lists) + len(cells), self.k), np.int32)
            self._lists = np.concatenate([self._lists[:known], room])
        self._lists[known : self._known] = np.where(nearest < self._tree.n, nearest, -1)
        self._numbers[cells] = np.arange(known, self._known)
