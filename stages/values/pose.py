"""Poses and motions in the plane: metres, radians, x forward, y left, heading counter-clockwise."""

import math
from typing import Annotated, Literal

from omninav.pipeline import Bounds, Value

Coordinate = Annotated[float, Bounds(ge=-1e8, le=1e8)]
"""Metres, or radians: no map is larger than the Earth."""
Spread = Annotated[float, Bounds(ge=0, le=1e8)]
"""A standard deviation, in metres or radians."""
Heading = Annotated[float, Bounds(ge=-2.0 * math.pi, le=2.0 * math.pi)]
"""A heading that a user types, in radians: degrees are mostly beyond."""
StartPose = tuple[Coordinate, Coordinate, Heading, Spread, Spread]
"""A first pose as a user gives it: x, y (m), heading (rad), sigma_xy (m), sigma_heading (rad)."""


class Pose(Value):
    """A pose (x, y in metres, heading in radians) in the map frame, or in the odometry's own where so said."""

    x: Coordinate
    y: Coordinate
    heading: Coordinate


class Motion(Value):
    """The robot's motion since the previous tick: an SE(2) increment in the robot's frame at that tick.

    `x` forward, `y` left (metres), `turn` (radians, counter-clockwise).
    """

    x: Coordinate
    y: Coordinate
    turn: Coordinate


class BridgedMotion(Motion):
    """A motion across a gap of the odometry, bridged from what is around it: less certain than a measured one.

    `unmeasured_s`: how long the gap is, in seconds; of motions that are parts of one, their squares add up to its own,
    since their errors are drawn one by one and the gap is as uncertain whatever the camera's rate.
    """

    unmeasured_s: Annotated[float, Bounds(ge=0)]


class AssumedMotion(Motion):
    """A motion that no odometry measured: far less certain than a measured one.

    `sigma_m`: standard deviation of its length. `sigma_turn`: of its turn (rad).
    """

    sigma_m: float
    sigma_turn: float


class UncertainMotion(Value):
    """A motion as rotation (rad), translation (m, negative: backwards) and rotation (rad), with their uncertainty.

    `steps`: the three; `sigmas`: their standard deviations. `geometry/plane/odometry_motion.py` applies them.
    """

    steps: tuple[float, float, float]
    sigmas: tuple[float, float, float]


class AssumedPose(Pose):
    """A pose by dead reckoning from assumed motions, in a frame of its own."""


PoseSource = Literal["truth", "odometry", "guess", "estimate"]
"""Origin of a stored pose: the log's ground truth, its odometry, a guess, or the system's own estimate."""
SOURCE_WORDS: dict[PoseSource, str] = {
    "truth": "ground truth",
    "odometry": "odometry",
    "guess": "motion guessed or seen in the images",
    "estimate": "the robot's own estimates",
}
"""Each source, as a sentence has it."""
OWN_FRAMES: tuple[PoseSource, ...] = ("odometry", "guess")
"""Sources whose poses begin at an origin of their own, and not in the frame of true poses or of a grid."""


def frame_of(odometry: Pose | None) -> PoseSource:
    """The source of poses that are stored where there is no ground truth."""
    return "guess" if isinstance(odometry, AssumedPose) else "odometry"
