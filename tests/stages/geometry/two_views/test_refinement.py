"""The damped least squares of a pose, on a problem with a known solution."""

import numba
import numpy as np
import pytest

from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.two_views.refinement import refinement


@numba.njit
def shifted(R: Array, t: Array, step: Array) -> tuple[Array, Array]:  # the translation alone is free
    return R, t + step


@numba.njit
def weighted_squares(R: Array, t: Array, points: Array, weights: Array, limit: float) -> float:
    return float((weights * (t - points) ** 2).sum())


@numba.njit
def quadratic(R: Array, t: Array, points: Array, weights: Array, limit: float, freedoms: int) -> tuple[Array, Array]:
    return weights[:, 0].sum() * np.eye(freedoms), (weights * (t - points)).sum(axis=0)


@numba.njit
def level(R: Array, t: Array, points: Array, weights: Array, limit: float) -> float:
    return 1.0


def test_it_finds_the_minimum_of_a_weighted_quadratic() -> None:
    points, weights = np.array([[1.0, 2.0, 3.0], [3.0, -2.0, 5.0]]), np.array([[1.0] * 3, [3.0] * 3])
    refined = refinement(weighted_squares, quadratic, shifted)
    # Damped by 0.001, then by a tenth of it: a step leaves 0.001 / 1.001 of the way, the next 0.0001 / 1.0001 of that.
    for steps, left in ((1, 1e-3 / 1.001), (2, 1e-7 / (1.001 * 1.0001)), (10, 0.0)):
        _, found = refined(np.eye(3), np.zeros(3), points, weights, 0.0, 3, steps)
        assert found == pytest.approx((1.0 - left) * np.array([2.5, -1.0, 4.5]), rel=1e-10)


def test_a_pose_that_nothing_improves_stays() -> None:
    rotation, translation = np.eye(3), np.ones(3)
    refined = refinement(level, quadratic, shifted)
    points, weights = np.zeros((1, 3)), np.ones((1, 3))
    np.testing.assert_equal(refined(rotation, translation, points, weights, 0.0, 3, 10), (rotation, translation))
