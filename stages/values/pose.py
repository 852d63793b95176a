"""Poses and motions in the plane: metres, radians, x forward, y left, heading counter-clockwise."""

from typing import Literal

from omninav.pipeline import Value


class Pose(Value):
    """A pose (x, y in metres, heading in radians) in the map frame, or in the odometry's own where so said."""

    x: float
    y: float
    heading: float


class Motion(Value):
    """How the robot moved since the tick before, seen from where it stood then: SE(2) increment.

    `x` forward, `y` left (metres), `turn` (radians, counter-clockwise).
    """

    x: float
    y: float
    turn: float


class UncertainMotion(Value):
    """A motion as a turn (rad), a way (m, negative: backwards) and a turn (rad), and how uncertain each is.

    `sigmas`: their standard deviations. `geometry/odometry_motion.py` moves poses and Gaussians by it.
    """

    way: tuple[float, float, float]
    sigmas: tuple[float, float, float]


PoseSource = Literal["truth", "odometry", "estimate"]
"""Where a stored pose comes from: the log's ground truth, its odometry, or the system's own estimate."""
