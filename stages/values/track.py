"""Continuity of a drive, as its images show it."""

from omninav.pipeline import Value


class Track(Value):
    """Continuity since landmarks surely told where the robot was: `unbroken` while each image continues the last.

    `carried`: this image shows other surroundings than the one before, though by odometry they are not far apart, so
    that somebody carried the robot, and nothing from before that tells where it is.
    """

    unbroken: bool
    carried: bool = False
