"""Commands to the wheels."""

from typing import Annotated

from omninav.pipeline import Bounds, Value


class Command(Value):
    """A command to a differential drive: `speed` forward (m/s) and `turning` (rad/s, counter-clockwise)."""

    speed: Annotated[float, Bounds(ge=-1e3, le=1e3)]
    turning: Annotated[float, Bounds(ge=-1e3, le=1e3)]
