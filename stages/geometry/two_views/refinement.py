"""The local optimum of a pose, by Levenberg and Marquardt's method, inside compiled loops."""

from collections.abc import Callable

import numba

from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.probability.small_systems import solve

Refinement = Callable[[Array, Array, Array, Array, float, int, int], tuple[Array, Array]]
MAX_DAMPING = 1e6
"""Damping beyond which no step leads further down."""


def refinement(
    cost: Callable[[Array, Array, Array, Array, float], float],
    normal_equations: Callable[[Array, Array, Array, Array, float, int], tuple[Array, Array]],
    moved: Callable[[Array, Array, Array], tuple[Array, Array]],
) -> Refinement:
    """A compiled function that brings a pose downhill: `refined(R, t, first, second, limit, freedoms, steps)`.

    All three functions are compiled ones. `cost(R, t, first, second, limit)`: with `first` and `second` what is
    compared, (N, 3) each, and `limit` the residual from which on more costs nothing.
    `normal_equations(R, t, first, second, limit, freedoms)`: J'WJ (D, D) and J'Wr (D,) of the weighted residuals of D
    freedoms. `moved(R, t, step)`: the pose after a step (D,).
    """

    @numba.njit(nogil=True)
    def refined(
        rotation: Array, translation: Array, first: Array, second: Array, limit: float, freedoms: int, steps: int
    ) -> tuple[Array, Array]:
        damping, least = 1e-3, cost(rotation, translation, first, second, limit)
        for _ in range(steps):
            square, slope = normal_equations(rotation, translation, first, second, limit, freedoms)
            improved, new, tried = False, least, (rotation, translation)
            while damping < MAX_DAMPING and not improved:
                damped = square.copy()
                for k in range(freedoms):
                    damped[k, k] += damping * damped[k, k] + 1e-12
                tried = moved(rotation, translation, -solve(damped, slope))
                new = cost(tried[0], tried[1], first, second, limit)
                improved = new < least
                if not improved:
                    damping *= 10.0
            if not improved:
                break
            converged = least - new <= 1e-9 * least
            (rotation, translation), least, damping = tried, new, max(0.1 * damping, 1e-9)
            if converged:
                break
        return rotation, translation

    return refined
