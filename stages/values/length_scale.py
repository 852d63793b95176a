"""How far the look of a place reaches."""

from omninav.pipeline import Value


class LengthScale(Value):
    """The distance at which two views of a map have lost half of what makes them more alike than strangers.

    `metres`: some tenths in a room, some hundredths between blades of grass. It is the unit in which "near a reference"
    is meant, so that one configuration serves all of them.
    """

    metres: float
