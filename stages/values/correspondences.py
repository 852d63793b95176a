"""Correspondences between two views."""

from typing import Annotated

from omninav.pipeline import Bounds, Shape, Value
from omninav.stages.geometry.arrays import Array, Ints


class Correspondences(Value):
    """Pairs of features, one of each of two views, that look similar; the clearest first.

    `first` (M,) and `second` (M,): their rows among the points of the first and of the second view, patches and then
    ends of columns (`LocalFeatures.point_bearings`). Nothing is in two pairs. `distance` (M,): how different they look,
    in the units of the stage that matched them. In homing the first view is the current one and the second the target.
    """

    first: Annotated[Ints, Shape("M"), Bounds(ge=0)]
    second: Annotated[Ints, Shape("M"), Bounds(ge=0)]
    distance: Annotated[Array, Shape("M"), Bounds(ge=0)]

    def __len__(self) -> int:
        return len(self.first)
