"""What navigation asks of the wheels."""

from omninav.pipeline import Value


class Command(Value):
    """A wish for a differential drive: `speed` forward (m/s) and `turning` (rad/s, counter-clockwise)."""

    speed: float
    turning: float
