"""Relative pose without samples: from all pairs, then from those that fit best."""

import math

import numpy as np
import numpy.typing as npt

from omninav.stages.geometry.two_views.epipolar import angular_residuals, decompose, eight_points, in_front
from omninav.stages.geometry.two_views.ransac import AgreedPose
from omninav.stages.geometry.two_views.relative_pose_ransac import agreement

MIN_PAIRS = 8
"""Pairs of a linear fit."""
ROUNDS, MIN_SHARE = 20, 0.3
"""Linear fits, each of fewer pairs, and the share of all pairs in the last one."""


def generate_and_select(first: npt.ArrayLike, second: npt.ArrayLike, threshold: float) -> AgreedPose | None:
    """Pose of view 2 seen from view 1, by Svoboda's algorithm as Goedemé et al. 2007, section 7.1.1, tell it.

    An overdetermined system is solved again and again, built from the pairs of unit bearings (N, 3) and (N, 3) that
    missed the essential matrix before by the least, fewer in each of the `ROUNDS`, down to `MIN_SHARE` of all; that
    with the best quality q_e counts. Pairs agree with it as in `relative_pose`, within `threshold` (rad).
    None for fewer than eight pairs. How many pairs are left out in a round is our reading.
    """
    first, second = np.asarray(first, np.float64), np.asarray(second, np.float64)
    if len(first) < MIN_PAIRS:
        return None
    outlierness, best, found = np.zeros(len(first)), math.inf, np.zeros((3, 3))
    for share in np.linspace(1.0, MIN_SHARE, ROUNDS):
        chosen = np.argsort(outlierness, kind="stable")[: max(MIN_PAIRS, round(share * len(first)))]
        matrix, quality = eight_points(first[chosen], second[chosen])
        if quality < best:
            best, found = float(quality), matrix
        outlierness = angular_residuals(matrix, first, second)
    rotations, translations = decompose(found)
    close = angular_residuals(found, first, second) <= threshold
    k = int(np.argmax(in_front((rotations, translations), first[close], second[close])))
    pose = rotations[k], translations[k]
    return AgreedPose(*pose, agreement(*pose, first, second, threshold), ROUNDS)
