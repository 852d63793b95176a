"""Which of some fixed points lie near a place: a grid of cells, each with the list of points that may be near."""

from typing import NamedTuple

import numba
import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

MOST_CELLS = 1 << 20


class NearbyGrid(NamedTuple):
    """Cells of `cell` metres from `origin` (2,) on; cell (i, j) lists `points[starts[i * rows + j] : starts[.. + 1]]`.

    The list holds every point within `radius` of any place in the cell, in ascending order, and some a little
    farther away. Places outside the grid have no point within `radius`.
    """

    origin: Array
    cell: float
    columns: int
    rows: int
    starts: Ints
    points: npt.NDArray[np.int32]


@numba.njit(cache=True, nogil=True)
def _fill(
    xy: Array,
    origin: Array,
    cell: float,
    columns: int,
    rows: int,
    radius: float,
    starts: Ints,
    points: Ints,
    fill: bool,
) -> None:
    for n in range(len(xy)):
        x, y = (xy[n, 0] - origin[0]) / cell, (xy[n, 1] - origin[1]) / cell
        reach = radius / cell
        for i in range(max(0, int(np.floor(x - reach))), min(columns - 1, int(np.floor(x + reach))) + 1):
            for j in range(max(0, int(np.floor(y - reach))), min(rows - 1, int(np.floor(y + reach))) + 1):
                dx = max(i - x, 0.0, x - i - 1.0)
                dy = max(j - y, 0.0, y - j - 1.0)
                if dx * dx + dy * dy <= reach * reach:
                    at = i * rows + j
                    if fill:
                        points[starts[at]] = n
                    starts[at] += 1


def nearby_grid(xy: Array, radius: float, cell: float | None = None) -> NearbyGrid:
    """The grid for points (N, 2) and a radius (m). `cell` defaults to a quarter of it, larger for huge areas."""
    xy = np.ascontiguousarray(xy[:, :2], np.float64)
    if not len(xy):
        return NearbyGrid(np.zeros(2), 1.0, 0, 0, np.zeros(1, np.int64), np.zeros(0, np.int32))
    origin = xy.min(axis=0) - radius
    span = xy.max(axis=0) + radius - origin
    cell = radius / 4 if cell is None else cell
    cell = max(cell, float(np.sqrt(span[0] * span[1] / MOST_CELLS)))
    columns, rows = (int(n) for n in np.floor(span / cell) + 1)
    counts = np.zeros(columns * rows, np.int64)
    _fill(xy, origin, cell, columns, rows, radius, counts, np.zeros(0, np.int32), False)
    starts = np.zeros(columns * rows + 1, np.int64)
    np.cumsum(counts, out=starts[1:])
    points = np.empty(starts[-1], np.int32)
    _fill(xy, origin, cell, columns, rows, radius, starts[:-1].copy(), points, True)
    return NearbyGrid(origin, cell, columns, rows, starts, points)
