"""Looks up the nearest of some fixed points in cells of the plane."""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial import KDTree

Array = npt.NDArray[np.float64]

MAX_CELLS = 1 << 20


class NearestCells(NamedTuple):
    """Cells of `cell` metres from `origin` (2,) on; cell (i, j) is row i * rows + j of `nearest` (cells, k).

    A row lists the points nearest to the cell's centre within a radius, nearest first, then -1. Places outside the
    cells have no point within the radius.
    """

    origin: Array
    cell: float
    columns: int
    rows: int
    nearest: npt.NDArray[np.int32]


def nearest_cells(points: Array, k: int, cell: float, radius: float) -> NearestCells:
    """The cells for points (N, >= 2), the k nearest within `radius` (m) each. `cell` grows for huge areas."""
    xy = np.ascontiguousarray(points[:, :2], np.float64)
    if not len(xy):
        return NearestCells(np.zeros(2), 1.0, 0, 0, np.full((0, k), -1, np.int32))
    origin = xy.min(axis=0) - radius
    span = xy.max(axis=0) + radius - origin
    cell = max(cell, float(np.sqrt(span[0] * span[1] / MAX_CELLS)))
    columns, rows = (int(n) for n in np.floor(span / cell) + 1)
    centres = np.stack(np.meshgrid(np.arange(columns) + 0.5, np.arange(rows) + 0.5, indexing="ij"), -1).reshape(-1, 2)
    tree: Any = KDTree(xy)  # type: ignore[no-untyped-call]
    found = tree.query(origin + cell * centres, k=[*range(1, k + 1)], distance_upper_bound=radius)[1]
    return NearestCells(origin, cell, columns, rows, np.where(found < len(xy), found, -1).astype(np.int32))
