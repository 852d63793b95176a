"""Random sampling (RANSAC), whatever is estimated: samples, how many are needed, and the result."""

import math
from dataclasses import dataclass

import numpy as np

from omninav.stages.geometry.arrays import Array, Bools, Ints

BATCH = 32
"""Samples that are drawn and solved at once."""


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
