"""Names of the parts of a place."""

from typing import Annotated

import numpy as np

from omninav.pipeline import Shape, Value
from omninav.stages.geometry.arrays import Array


class Rooms(Value):
    """Named rectangles of a floor, as its owner knows them: truth.

    `names` (R,); `corners` (R, 4): least x, least y, greatest x, greatest y (m, map frame).
    """

    is_truth = True
    names: Annotated[tuple[str, ...], Shape("R")]
    corners: Annotated[Array, Shape("R", 4)]

    def at(self, x: float, y: float) -> str:
        """The room at a point, the smallest of several; "" where there is none."""
        x0, y0, x1, y1 = self.corners.T
        inside = np.flatnonzero((x0 <= x) & (x <= x1) & (y0 <= y) & (y <= y1))
        if not len(inside):
            return ""
        areas = (x1 - x0)[inside] * (y1 - y0)[inside]
        return self.names[int(inside[np.argmin(areas)])]
