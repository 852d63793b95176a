"""Delay of a camera's images: how much later than they were taken they are stamped."""

import math
from dataclasses import dataclass, field

import numpy as np

from omninav.stages.geometry.arrays import Array

from .se2 import between, compose, interpolate, wrap

MAX_DELAY_S = 1.0
"""Largest delay that is looked for, either way, s."""
ROUNDS = 10
"""Rounds of least squares."""
MIN_DELAY_S, MIN_SIGMAS = 0.02, 8.0
"""Delay below which it is taken for none: in seconds, and in its standard deviations."""
FINE_DELAY_S = 0.003
"""Difference of two delays below which they are the same, s."""
MIN_TURNS = 40
"""Steps between images that a delay is found from, at least."""
MIN_SIGMA = math.radians(0.05)
"""Standard deviation of the difference of two turns, at least (rad)."""
MAX_UNEXPLAINED = 0.25
"""Largest part of the camera's squared turns that odometry leaves unexplained: of a robot that drives straight both
have their errors alone, whose slopes mean nothing."""
LOOSE = math.radians(1.0)
"""Difference of two turns at which they count by half (Cauchy), at least (rad)."""


@dataclass(frozen=True)
class RobotPath:
    """Poses of a robot at references of a tour, and at the times shortly before and after.

    `poses` (R, 3) at `stamps` (R,) in seconds, ascending; `driven` (N, 3) at `times` (N,): the whole drive, empty where
    it is not known.
    """

    poses: Array
    stamps: Array = field(default_factory=lambda: np.empty(0))
    driven: Array = field(default_factory=lambda: np.empty((0, 3)))
    times: Array = field(default_factory=lambda: np.empty(0))

    def before(self, delay_s: float) -> Array:
        """Poses (R, 3) at a number of seconds before the stamps, by straight steps of the drive."""
        if not delay_s or not len(self.times):
            return self.poses
        then, now = (interpolate(self.times, self.driven, at) for at in (self.stamps - delay_s, self.stamps))
        return compose(self.poses, between(now, then))


def found_delay(camera: Array, robot: RobotPath) -> float:
    """The delay (s, positive: images are late) that turns of a camera with poses (R, 3), in order, show; 0 for none."""
    delay, sigma = measured_delay(camera, robot)
    return delay if abs(delay) > max(MIN_DELAY_S, MIN_SIGMAS * sigma) else 0.0


def measured_delay(camera: Array, robot: RobotPath) -> tuple[float, float]:
    """The delay (s) and its standard deviation, infinite where few turns, errors or a long delay show none.

    The robot's turns are those of the camera where the delay is right, wherever the camera sits. Least squares find it
    with slopes over whole intervals between images, long ones first: these are independent of the noise of poses,
    while poses between two that were measured have less noise and would fit better whatever the delay is.
    """
    if len(camera) <= MIN_TURNS or len(robot.times) <= MIN_TURNS:
        return 0.0, math.inf
    seen, interval = np.diff(camera[:, 2]), float(np.median(np.diff(robot.times)))

    def missed(delay: float) -> Array:
        return wrap(seen - np.diff(robot.before(delay)[:, 2]))

    delay, spread, reach = 0.0, 0.0, interval * max(1, int(MAX_DELAY_S / interval))
    for _ in range(ROUNDS):
        there = missed(delay)
        slopes = wrap(missed(delay + reach) - missed(delay - reach)) / (2.0 * reach)
        reach = max(interval, interval * round(reach / interval / 2.0))
        loose = max(LOOSE, float(np.median(np.abs(there))))
        weights = 1.0 / (1.0 + (there / loose) ** 2)
        square = max(float(weights @ slopes**2), 1e-9)
        delay -= float(weights @ (there * slopes)) / square
        if abs(delay) > MAX_DELAY_S:
            return 0.0, math.inf
        # Odometry that slips is wrong in turns alone: the mean error of all steps, mostly straight ones, would hide it.
        of_all, of_turns = weights @ there**2 / weights.sum(), (weights * slopes) ** 2 @ there**2 / square
        spread = math.sqrt(max(float(of_all), float(of_turns), MIN_SIGMA**2) / square)
    if weights @ there**2 > MAX_UNEXPLAINED * (weights @ wrap(seen) ** 2):
        return 0.0, math.inf
    return delay, spread
