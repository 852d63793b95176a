"""Visibility areas: from where the views of a map can be seen."""

from typing import Annotated

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Shape, Starts, Value
from omninav.stages.geometry.arrays import Array, Bools


class VisibilityAreas(Value):
    """The visibility areas of a map's references (Wolf, Burgard & Burkhardt 2005, section V), by sector.

    A reference looks along the azimuths `axes` (S,) (rad, counter-clockwise from its heading). `target` (R, S): which
    point lambda it sees there, -1 where there is none in the grid. `points` (T, 2): those points, x, y (m, map frame).
    An area belongs to its point, whoever looks at it: the cells from which it is visible, as runs of a row. Those of
    point t are `runs[starts[t] : starts[t + 1]]`, `runs` (N, 3) row, first column, column behind the last. Grid:
    `shape` rows, columns; `resolution` (m); `origin` x, y (m) of its lower left corner.
    """

    axes: Annotated[Array, Shape("S")]
    target: Annotated[npt.NDArray[np.int32], Shape("R", "S"), Bounds(ge=-1)]
    points: Annotated[Array, Shape("T", 2)]
    starts: Annotated[npt.NDArray[np.int32], Shape("T+1"), Starts("N")]
    runs: Annotated[npt.NDArray[np.uint16], Shape("N", 3)]
    shape: tuple[int, int]
    resolution: Annotated[float, Bounds(gt=0)]
    origin: tuple[float, float]

    @property
    def nbytes(self) -> int:
        """Bytes of its arrays as stored."""
        return sum(a.nbytes for a in (self.axes, self.target, self.points, self.starts, self.runs))

    def mask(self, point: int) -> Bools:
        """The cells from which a point is visible: (rows, columns)."""
        seen = np.zeros(self.shape, np.bool_)
        for row, first, behind in self.runs[self.starts[point] : self.starts[point + 1]]:
            seen[row, first:behind] = True
        return seen
