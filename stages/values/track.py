"""Continuity of a drive, as its images show it."""

from omninav.pipeline import Value


class Track(Value):
    """Continuity since landmarks surely told where the robot was: `unbroken` while each image continues the last."""

    unbroken: bool
