"""Delay of a drive's images, by the headings that the landmarks of the map show."""

import math
from dataclasses import field, replace
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Shape, Value
from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.plane.image_delay import RobotPath, measured_delay

MAX_IMAGES = 512
"""Images that are kept: at two a second those of four minutes."""
MIN_INTERVAL_S = 0.19
"""Shortest time between two that are kept, s: over shorter ones headings differ by their errors alone."""
EVERY = 16
"""Images between two searches, of a millisecond each."""
MIN_CHANGE_S, MIN_SIGMAS = 0.03, 6.0
"""Smallest difference from the delay that is allowed for which counts, in seconds and in standard deviations: in six
drives without a delay it is at most 3.6 of these (docs/experiments/landmarks.md)."""
FINE_SIGMA_S = 0.01
"""Largest standard deviation (s) at which a search refines a delay that was found: where the robot stands or drives
straight its headings tell less."""


class LateImages(Value):
    """Headings of a drive by landmarks and by odometry, and by how much later the former are stamped.

    `rows` (N, 3): times (s), headings by odometry and by landmarks (rad), NaN where an image shows no sure pose.
    `now` (2,): time and heading by odometry at the last image. `delay_s`: how much later images are, NaN before it is
    found. `unsearched`: images that were kept since the last search.
    """

    rows: Annotated[Array, Shape("N", 3)] = field(default_factory=lambda: np.empty((0, 3)))
    now: Annotated[Array, Shape(2)] = field(default_factory=lambda: np.zeros(2))
    delay_s: float = math.nan
    unsearched: Annotated[int, Bounds(ge=0)] = 0

    def allowed(self, by_map: float) -> float:
        """The delay (s) to allow for: the one that was found, else the map's."""
        return by_map if math.isnan(self.delay_s) else self.delay_s

    def interrupted(self) -> "LateImages":
        """Begins anew where no motion was measured; a delay that was found stays."""
        return LateImages(delay_s=self.delay_s)

    def driven(self, turn: float, seconds: float) -> "LateImages":
        """Adds an image, `turn` (rad) and `seconds` after the last one."""
        now = np.add(self.now, [seconds, turn])
        if len(self.rows) and now[0] - self.rows[-1, 0] < MIN_INTERVAL_S:
            return replace(self, now=now)
        rows = np.concatenate([self.rows[-MAX_IMAGES + 1 :], [[*now, math.nan]]])
        return replace(self, now=now, rows=rows, unsearched=self.unsearched + 1)

    def seen(self, heading: float, allowed_s: float) -> "LateImages":
        """Adds that landmarks show the last image's heading (rad); `allowed_s`: the delay that is allowed for so far.

        Nothing is searched in the first `EVERY` images.
        """
        if not len(self.rows) or self.rows[-1, 0] < self.now[0]:
            return self
        rows = self.rows.copy()
        rows[-1, 2] = heading
        new = replace(self, rows=rows)
        if self.unsearched < EVERY:
            return new
        shown = ~np.isnan(rows[:, 2])
        driven, camera = np.zeros((2, *rows.shape))
        driven[:, 2], camera[:, 2] = rows[:, 1:].T
        delay, sigma = measured_delay(camera[shown], RobotPath(driven[shown], rows[shown, 0], driven, rows[:, 0]))
        changed = abs(delay - allowed_s) >= max(MIN_CHANGE_S, MIN_SIGMAS * sigma)
        finer = not math.isnan(self.delay_s) and sigma <= FINE_SIGMA_S
        return replace(new, unsearched=0, delay_s=delay if changed or finer else self.delay_s)
