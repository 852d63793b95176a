"""Commands to the wheels."""

from omninav.pipeline import Value


class Command(Value):
    """A command to a differential drive: `speed` forward (m/s) and `turning` (rad/s, counter-clockwise)."""

    speed: float
    turning: float
