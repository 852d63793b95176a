"""Relation of turns that a camera sees to turns that odometry measures: alike, reversed, scaled or late."""

import math
from typing import NamedTuple

import numpy as np

from omninav.stages.geometry.arrays import Array

MAX_TURN = math.radians(60.0)
"""Turns count up to this: one wrong turn must not outweigh the others."""
MAX_DELAY_S, DELAY_STEPS = 4.0, 0.125
"""Delays that are tried, and their step as a share of the time between images."""


class TurnFit(NamedTuple):
    """Which sign (1, -1) and delay (s, positive: images are late) of measured turns explain most of what is seen.

    `explained`: the share of the seen turning; `as_is`: the same with neither.
    """

    sign: int
    delay_s: float
    explained: float
    as_is: float


def explained(seen: Array, measured: Array) -> Array:
    """1 - sum |seen - measured| / sum |seen| over the last axis: 1 where they are equal, 0 where nothing is gained."""
    rest = np.abs(clipped(seen) - clipped(measured)).sum(axis=-1)
    share: Array = 1.0 - rest / max(float(np.abs(clipped(seen)).sum()), 1e-9)
    return share


def clipped(turns: Array) -> Array:
    """Turns up to `MAX_TURN`."""
    return np.clip(turns, -MAX_TURN, MAX_TURN)


def turn_fit(times: Array, headings: Array, seen: Array) -> TurnFit:
    """Compare the turns (N - 1,) that are seen between images with `headings` (N,), not wrapped, at their times (N,).

    Seen turns that are not known are NaN. Delays shorter than half the time between images cannot be told.
    """
    known = np.isfinite(seen)
    step = DELAY_STEPS * float(np.median(np.diff(times)))
    most = max(1, int(MAX_DELAY_S / step))
    delays = step * np.arange(-most, most + 1)
    turns = np.diff(np.interp(times - delays[:, None], times, headings), axis=1)[:, known]
    there = seen[known]
    both = np.stack([explained(there, turns), explained(there, -turns)])
    sign, at = np.unravel_index(int(both.argmax()), both.shape)
    return TurnFit(1 - 2 * int(sign), float(delays[at]), float(both.max()), float(both[0, most]))
