"""The local optimum of a pose, by Levenberg and Marquardt's method."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Pose = tuple[Array, Array]
"""Rotation (3, 3) and translation (3,)."""
MAX_DAMPING = 1e6
"""Beyond it no step leads further down."""


def refined(
    pose: Pose,
    cost: Callable[[Array, Array], float],
    normal_equations: Callable[[Array, Array], tuple[Array, Array]],
    moved: Callable[[Array, Array, Array], Pose],
    steps: int = 10,
) -> Pose:
    """The pose with the lowest `cost` that is reached downhill from `pose`.

    `normal_equations` gives J'WJ (D, D) and J'Wr (D,) of the weighted residuals, and `moved` the pose after a step (D,)
    of its freedoms.
    """
    damping, least = 1e-3, cost(*pose)
    for _ in range(steps):
        square, slope = normal_equations(*pose)
        improved = False
        while damping < MAX_DAMPING and not improved:
            damped = square.copy()
            damped.flat[:: len(slope) + 1] *= 1.0 + damping
            damped.flat[:: len(slope) + 1] += 1e-12
            step = -np.asarray(np.linalg.solve(damped, slope), np.float64)
            tried = moved(*pose, step)
            new = cost(*tried)
            improved = new < least
            if not improved:
                damping *= 10.0
        if not improved:
            return pose
        converged = least - new <= 1e-9 * least
        pose, least, damping = tried, new, max(0.1 * damping, 1e-9)
        if converged:
            return pose
    return pose
