"""Matches of two images that fit the motion between them."""

import math

import numpy as np

from omninav.pipeline.engine.compiled import compiled
from omninav.stages.geometry.arrays import Array, Bools


def fit_motion(first: Array, second: Array, motion: Array, tolerance: float) -> Bools:
    """Which matched bearings (M, 3) of two images one point each may have, seen before and after a motion.

    `motion` (3,): x, y (m), turn (rad) of the second robot in the frame of the first. Both bearings lie within
    `tolerance` (rad) of one plane through both cameras, and meet ahead of both.
    """
    out = np.zeros(len(first), np.bool_)
    length = math.hypot(motion[0], motion[1])
    if length > 0.0:
        _fit(first, second, motion[0] / length, motion[1] / length, motion[2], math.sin(tolerance), out)
    return out


@compiled(nogil=True)
def _fit(first: Array, second: Array, x: float, y: float, turn: float, sine: float, out: Bools) -> None:
    cos, sin = math.cos(turn), math.sin(turn)
    for n in range(len(first)):
        a = first[n]
        b0 = cos * second[n, 0] - sin * second[n, 1]
        b1 = sin * second[n, 0] + cos * second[n, 1]
        b2 = second[n, 2]
        n0, n1, n2 = y * b2, -x * b2, x * b1 - y * b0  # normal of the plane: t x b
        m0, m1, m2 = y * a[2], -x * a[2], x * a[1] - y * a[0]  # t x a
        normal = math.sqrt(n0 * n0 + n1 * n1 + n2 * n2)
        flat = abs(a[0] * n0 + a[1] * n1 + a[2] * n2) <= sine * normal
        same_side = n0 * m0 + n1 * m1 + n2 * m2 > 0.0
        ahead = a[0] * x + a[1] * y > b0 * x + b1 * y  # a nearer point falls back behind a robot that drives on
        out[n] = flat and same_side and ahead
