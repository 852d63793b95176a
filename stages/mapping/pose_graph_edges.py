"""What joins the poses of a pose graph: odometry, and pairs of views that show one place."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

SIGMAS_PER_METRE = (0.02, 0.02, 0.02)
"""Standard deviation of odometry per metre (m, m, rad)."""
TURN_SIGMA = 0.05
"""The same of a turn, per radian."""
MIN_SIGMAS = (0.005, 0.005, 0.0025)
"""Of the shortest motion (m, m, rad): poses in a map are samples of a drive."""


class Closures(NamedTuple):
    """Pairs of views that show one place. `pairs` (C, 2), the earlier first; `turns` (C,): heading of the later in the
    frame of the earlier (rad)."""

    pairs: Ints
    turns: Array


def odometry_sigmas(motions: Array) -> Array:
    """Standard deviations (E, 3) of motions (E, 3) that odometry measured (m, m, rad)."""
    length = np.hypot(motions[:, 0], motions[:, 1])
    sigmas: Array = np.asarray(MIN_SIGMAS) + np.asarray(SIGMAS_PER_METRE) * length[:, None]
    sigmas[:, 2] += TURN_SIGMA * np.abs(motions[:, 2])
    return sigmas
