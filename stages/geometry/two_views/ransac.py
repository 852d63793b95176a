"""Random sampling (RANSAC) of poses, whatever they are judged by: samples, the result, and its local optimum."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from omninav.stages.geometry.arrays import Array, Bools, Ints
from omninav.stages.geometry.probability.small_systems import solve

BATCH = 32
"""Samples that are drawn and solved at once."""
STEPS = 10
"""Steps of a refinement, at most."""
MAX_DAMPING = 1e6
"""Damping beyond which no step leads further down."""


@dataclass(frozen=True, eq=False)
class AgreedPose:
    """A camera seen from another frame (X = R Xc + t): `rotation` (3, 3), `translation` (3,).

    `inliers` (N,): which of the bearings agree with it. `samples`: how many were drawn.
    """

    rotation: Array
    translation: Array
    inliers: Bools
    samples: int


def samples_of(number: int, size: int, rng: np.random.Generator) -> Ints:
    """The next `BATCH` samples (BATCH, size) of `number` rows, none twice in a sample. Draws from `rng`."""
    return np.argsort(rng.random((BATCH, number)), axis=1)[:, :size]


def samples_needed(share: float, size: int, confidence: float) -> float:
    """After how many samples one without an outlier is among them with `confidence`, at this share of inliers."""
    good = share**size
    if good >= confidence:
        return 1.0
    return math.log(1.0 - confidence) / math.log1p(-good) if good > 1e-12 else math.inf


def refined(
    cost: Callable[[Array, Array, Array, Array, float], float],
    normal_equations: Callable[[Array, Array, Array, Array, float, int], tuple[Array, Array]],
    moved: Callable[[Array, Array, Array], tuple[Array, Array]],
    pose: tuple[Array, Array],
    first: Array,
    second: Array,
    limit: float,
    freedoms: int,
    steps: int = STEPS,
) -> tuple[Array, Array]:
    """A pose (R, t) brought downhill by Levenberg and Marquardt's method.

    `cost(R, t, first, second, limit)`: with `first` and `second` what is compared, (N, 3) each, and `limit` the
    residual from which on more costs nothing. `normal_equations(R, t, first, second, limit, freedoms)`: J'WJ (D, D)
    and J'Wr (D,) of the weighted residuals of D freedoms. `moved(R, t, step)`: the pose after a step (D,).
    """
    damping, least = 1e-3, cost(*pose, first, second, limit)
    for _ in range(steps):
        square, slope = normal_equations(*pose, first, second, limit, freedoms)
        before = least
        while damping < MAX_DAMPING and least == before:
            tried = moved(*pose, -solve(square + np.diag(damping * np.diag(square) + 1e-12), slope))
            new = cost(*tried, first, second, limit)
            if new < least:
                pose, least, damping = tried, new, max(0.1 * damping, 1e-9)
            else:
                damping *= 10.0
        if before - least <= 1e-9 * before:
            break
    return pose
