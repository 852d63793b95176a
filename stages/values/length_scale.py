"""The appearance length scale."""

from typing import Annotated

from omninav.pipeline import Bounds, Value

DEFAULT_M = 0.5
"""Length scale of a map that was not measured, metres: a room's."""


class LengthScale(Value):
    """The distance at which two views of a map have lost half of their excess similarity, a correlation length.

    `metres`: some tenths in a room, some hundredths between blades of grass. Distances from references are given in
    this unit, so that one configuration serves all places.
    """

    metres: Annotated[float, Bounds(gt=0)]


def metres_of(length_scale: LengthScale | None) -> float:
    """The length scale in metres, `DEFAULT_M` where it was not measured."""
    return DEFAULT_M if length_scale is None else length_scale.metres
