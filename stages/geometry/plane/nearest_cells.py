"""Looks up the nearest of some fixed points in cells of the plane."""

from typing import Any

import numpy as np

from omninav.stages.geometry.arrays import Array, Shorts

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
        # Which list each cell has: 0, the empty one, of cells without and of all outside. Memory is taken when written.
        self._numbers = np.zeros(self._columns * self._rows + 1, np.int32)
        self._lists = np.full((1, k), -1, np.int32)

    def of(self, poses: Array) -> Shorts:
        """The points nearest to the cell of each pose (M, >= 2): (M, k), nearest first, then -1."""
        column, row = np.floor((poses[:, :2] - self.origin) * (1.0 / self.cell)).astype(np.int64).T
        inside = (column >= 0) & (column < self._columns) & (row >= 0) & (row < self._rows)
        cells = np.where(inside, column * self._rows + row, -1)
        new = np.unique(cells[inside & (self._numbers[cells] == 0)])
        if len(new):
            centres = self.origin + self.cell * (np.column_stack(np.divmod(new, self._rows)) + 0.5)
            found = self._tree.query(centres, k=[*range(1, self.k + 1)], distance_upper_bound=self.radius)[1]
            self._numbers[new] = len(self._lists) + np.arange(len(new))
            self._lists = np.concatenate([self._lists, np.where(found < self._tree.n, found, -1).astype(np.int32)])
        return self._lists[self._numbers[cells]]
