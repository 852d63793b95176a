"""The appearance length scale."""

from typing import Annotated

from omninav.pipeline import Bounds, Value


class LengthScale(Value):
    """The distance at which two views of a map have lost half of their excess similarity, a correlation length.

    `metres`: some tenths in a room, some hundredths between blades of grass. Distances from references are given in
    this unit, so that one configuration serves all places.
    """

    metres: Annotated[float, Bounds(gt=0)]
