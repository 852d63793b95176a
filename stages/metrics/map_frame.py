"""The frame of a map whose poses are not true ones, as the estimates in it show it."""

import numpy as np

from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.plane.pose_errors import position_errors
from omninav.stages.geometry.plane.se2 import between, compose

from .relative_errors import align

TRIED = 500
"""Most images whose estimates are each tried as the one that is right."""
FITS = 2.0
"""Most distance, over the median, of an estimate that counts in the last fit."""
SPREAD = 10.0
"""Least extent of the true positions, over the median distance, for which they and not the headings give the turn."""


def in_map_frame(truth: Array, estimate: Array) -> Array:
    """Aligns true poses (N, 3) with the estimates (N, 3) in a map's frame by one rigid motion, robustly.

    Each estimate in turn proposes the motion for which it is exact. The one with the least median distance is refined
    by least squares over the estimates near it (inliers), so that a robot that is lost for less than half of the time
    does not change it; its turn is that of the headings where the robot hardly moves. Rows of NaN stay NaN.
    """
    known = np.isfinite(truth[:, 0]) & np.isfinite(estimate[:, 0])
    if not known.any():
        return truth
    there, believed = truth[known], estimate[known]
    rows = np.unique(np.linspace(0, len(there) - 1, TRIED).astype(np.int64))
    origin = np.zeros(3)
    motions = compose(believed[rows], between(there[rows], origin))
    best, least = motions[0], np.inf
    for motion in motions:
        distance = float(np.median(position_errors(compose(motion, there), believed)))
        if distance < least:
            best, least = motion, distance
    near = position_errors(compose(best, there), believed) <= FITS * least
    there, believed = there[near], believed[near]
    turn = np.angle(np.exp(1j * (believed[:, 2] - there[:, 2])).sum())
    if (extent := np.ptp(there[:, :2], axis=0).max()) > 0.0:
        rotation, to = align(there[:, :2], believed[:, :2])
        by_place = np.arctan2(rotation[1, 0], rotation[0, 0])
        if extent > SPREAD * np.median(position_errors(compose([*to, by_place], there), believed)):
            turn = by_place
    shift = (believed - compose([0.0, 0.0, turn], there))[:, :2].mean(axis=0)
    return compose([*shift, turn], truth)
