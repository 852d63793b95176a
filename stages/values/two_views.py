"""Two views of the same points, as bearings, and how the second was taken from the first."""

from typing import Annotated

from omninav.pipeline import Bounds, Shape, Value
from omninav.stages.geometry.arrays import Array, Bools


class BearingPairs(Value):
    """Correspondences of two views. `first`, `second`: (N, 3) unit vectors in the robot's frame of each view."""

    first: Annotated[Array, Shape("N", 3)]
    second: Annotated[Array, Shape("N", 3)]

    def __len__(self) -> int:
        return len(self.first)


class RelativeView(Value):
    """Camera 2 seen from camera 1: X1 = R X2 + t with `rotation` R (3, 3) and unit `translation` t (3,).

    `inliers` (N,): which pairs agree with it. `samples`: how many were tried (0: known, not found).
    """

    rotation: Annotated[Array, Shape(3, 3)]
    translation: Annotated[Array, Shape(3)]
    inliers: Annotated[Bools, Shape("N")]
    samples: Annotated[int, Bounds(ge=0)] = 0
