"""Continuity of a drive, as its images show it."""

from omninav.pipeline import Value


class Track(Value):
    """Continuity since landmarks last surely located the robot: `unbroken` while each image continues the last.

    `carried`: this image shows other surroundings than the one before, though by odometry they are not far apart, so
    that the robot was carried, and nothing from before that shows where it is.
    """

    unbroken: bool
    carried: bool = False
