"""Delay of a camera's images: how much later than they were taken they are stamped."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from omninav.stages.geometry.arrays import Array

from .se2 import between, compose, interpolate, wrap

MAX_DELAY_S = 1.0
"""Largest delay that is looked for, either way, s."""
STEPS_S = (0.02, 0.001)
"""Steps in which delays are tried, over all of them and around the best, s."""
MIN_DELAY_S, MIN_SIGMAS = 0.02, 4.0
"""Delay below which it is taken for none: in seconds, and in its standard deviations."""
FINE_DELAY_S = 0.003
"""Difference of two delays below which they are the same, s."""
MIN_TURNS = 20
"""Steps between images that a delay is found from, at least."""
MIN_SIGMA = math.radians(0.05)
"""Standard deviation of the difference of two turns, at least (rad)."""
LOOSE = math.radians(1.0)
"""Turn that odometry may be off between two images (rad): errors beyond count less (Cauchy)."""


@dataclass(frozen=True)
class RobotPath:
    """Poses of a robot at references of a tour, and at the times shortly before and after.

    `poses` (R, 3) at `stamps` (R,) in seconds, ascending; `driven` (N, 3) at `times` (N,): the whole drive.
    """

    poses: Array
    stamps: Array
    driven: Array
    times: Array

    def before(self, delay_s: float) -> Array:
        """Poses (R, 3) at so many seconds before the stamps, by straight steps of the drive."""
        if not delay_s:
            return self.poses
        then, now = (interpolate(self.times, self.driven, at) for at in (self.stamps - delay_s, self.stamps))
        return compose(self.poses, between(now, then))


def found_delay(camera: Array, before: Callable[[float], Array]) -> float:
    """The delay (s, positive: images are late) that turns of a camera with poses (R, 3), in order, show; 0 for none.

    `before(delay)`: poses (R, 3) of the robot at so many seconds before the stamps of its images. Its turns are those
    of the camera where the delay is right, wherever the camera sits.
    """
    if len(camera) <= MIN_TURNS:
        return 0.0
    seen = np.diff(camera[:, 2])

    def missed(delays: Array) -> Array:
        return np.array([wrap(seen - np.diff(before(float(delay))[:, 2])) for delay in delays])

    best, reach = 0.0, MAX_DELAY_S
    for step in STEPS_S:
        delays = best + np.arange(-reach, reach + step / 2.0, step)
        best, reach = float(delays[np.log1p((missed(delays) / LOOSE) ** 2).sum(axis=1).argmin()]), step
    early, there, late = missed(best + STEPS_S[0] * np.array([-1.0, 0.0, 1.0]))
    weights = 1.0 / (1.0 + (there / LOOSE) ** 2)
    slopes = (late - early) / (2.0 * STEPS_S[0])
    variance = max(float(weights @ there**2 / weights.sum()), MIN_SIGMA**2)
    sigma = math.sqrt(variance / max(float(weights @ slopes**2), 1e-9))
    return best if abs(best) > max(MIN_DELAY_S, MIN_SIGMAS * sigma) else 0.0
