"""Odometry made of true positions, where a log has none."""

import math

import numpy as np

from omninav.stages.geometry.arrays import Array


def add_odometry_noise(
    increment: Array, noise: Array, distance: float, turn_per_metre: float, turn_per_radian: float
) -> Array:
    """An increment of motion (3,) as a poor odometry would have measured it.

    `noise`: two independent standard normal numbers n1, n2. With d the length of the increment (m) and t its turn
    (rad), the length becomes d + distance sqrt(d) n1 and the turn t + e, e = sqrt(turn_per_metre^2 d +
    turn_per_radian^2 |t|) n2; the translation is turned by e / 2, as if the error had grown evenly on the way.
    Variances grow with the way, so that cutting it into more frames changes nothing: over one metre the standard
    deviations are `distance` (metres, that is, the share of the way) and `turn_per_metre` (radians); a turn of one
    radian adds `turn_per_radian`. The model is the odometry motion model of Thrun, Burgard & Fox, Probabilistic
    Robotics (2005), section 5.4, with variances in place of standard deviations.
    """
    length, turn = math.hypot(increment[0], increment[1]), abs(float(increment[2]))
    error = math.sqrt(turn_per_metre**2 * length + turn_per_radian**2 * turn) * float(noise[1])
    scale = 1.0 + distance / math.sqrt(length) * float(noise[0]) if length > 0 else 1.0
    cos, sin = math.cos(error / 2) * scale, math.sin(error / 2) * scale
    x, y = float(increment[0]), float(increment[1])
    return np.array([cos * x - sin * y, sin * x + cos * y, float(increment[2]) + error])
