"""Room around a robot, by a ring of ranges."""

import math

import numpy as np

from omninav.stages.geometry.arrays import Array

LOOKAHEAD_M = 0.8
"""Free distance that a direction needs where the target is not closer, metres."""
REACTION_S = 0.25
"""Time until a robot brakes, seconds: a tick, and some delay."""


def free_ahead(ranges: Array, azimuths: Array, radius: float, margin: float) -> float:
    """Distance (m) that a disc of `radius` m can go straight on, `margin` m clear to both sides, by ranges (N,)."""
    ahead, beside = ranges * np.cos(azimuths), np.abs(ranges * np.sin(azimuths))
    in_the_way = (np.cos(azimuths) > 0.1) & (beside < radius + margin)
    return float(ahead[in_the_way].min(initial=float(ranges.max()))) - radius


def stopping_speed(free: float, deceleration: float) -> float:
    """Largest speed (m/s) from which a robot that brakes by `deceleration` m/s^2 stops within `free` m."""
    lag = REACTION_S * deceleration
    return math.sqrt(lag**2 + 2.0 * deceleration * max(0.0, free)) - lag


def roomier_side(ranges: Array, azimuths: Array) -> float:
    """Side with more room in front: the mean distance (m) to the left of (N,) ranges, negative to the right."""
    front = np.cos(azimuths) > -0.1
    return float((ranges * np.sin(azimuths))[front].mean())


def free_direction(
    ranges: Array, azimuths: Array, wanted: float, room: float, radius: float, margin: float
) -> float | None:
    """The direction (rad) closest to `wanted` in which a disc can go `room` m straight on.

    In steps of 5 degrees, of two equally close ones that with more room; None where there is none up to 90 degrees off.
    """
    step = np.radians(5.0)
    for k in range(19):
        found = [
            (free_ahead(ranges, azimuths - at, radius, margin), at)
            for at in ((wanted,) if k == 0 else (wanted + k * step, wanted - k * step))
        ]
        free, at = max(found, key=lambda pair: pair[0])
        if free >= room:
            return float(at)
    return None
