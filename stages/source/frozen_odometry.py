"""Odometry that says that the robot stands, while ground truth moves."""

from itertools import groupby

import numpy as np

from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.plane.se2 import between

STILL = 1e-9
"""Metres and radians: below, odometry has not changed between two images."""
MIN_STEP_M, MIN_STEPS, MIN_DISTANCE_M = 0.01, 5, 0.5
"""Truth that moves by this much between two images, so often in a row and so far in all, is neither noise nor a robot
that was lifted."""


def frozen_steps(odometry: Array, truth: Array) -> tuple[int, float]:
    """Number of images between which odometry stood still while the truth moved on, and how far that went (m).

    Both are poses (N, 3) at the images; a row of truth that is NaN moves nothing.
    """
    still = (np.abs(between(odometry[:-1], odometry[1:])) < STILL).all(axis=1)
    moved = np.hypot(*(truth[1:, :2] - truth[:-1, :2]).T)
    frozen = still & (moved > MIN_STEP_M)
    steps, metres, at = 0, 0.0, 0
    for is_frozen, group in groupby(frozen.tolist()):
        length = len(list(group))
        way = float(np.hypot(*(truth[at + length, :2] - truth[at, :2])))
        if is_frozen and length >= MIN_STEPS and way >= MIN_DISTANCE_M:
            steps, metres = steps + length, metres + way
        at += length
    return steps, metres
