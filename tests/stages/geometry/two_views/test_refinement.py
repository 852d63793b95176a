"""The damped least squares of a pose, on a problem with a known solution."""

import numba
import numpy as np
import pytest

from omninav.stages.geometry.two_views.refinement import refinement


@numba.njit
def shifted(
    rotation: np.ndarray, translation: np.ndarray, step: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:  # the translation alone is free
    return rotation, translation + step


@numba.njit
def weighted_squares(
    rotation: np.ndarray, translation: np.ndarray, points: np.ndarray, weights: np.ndarray, limit: float
) -> float:
    return float((weights * (translation - points) ** 2).sum())


@numba.njit
def quadratic(
    rotation: np.ndarray, translation: np.ndarray, points: np.ndarray, weights: np.ndarray, limit: float, freedoms: int
) -> tuple[np.ndarray, np.ndarray]:
    return weights[:, 0].sum() * np.eye(freedoms), (weights * (translation - points)).sum(axis=0)


@numba.njit
def level(
    rotation: np.ndarray, translation: np.ndarray, points: np.ndarray, weights: np.ndarray, limit: float
) -> float:
    return 1.0


def test_it_finds_the_minimum_of_a_weighted_quadratic() -> None:
    points, weights = np.array([[1.0, 2.0, 3.0], [3.0, -2.0, 5.0]]), np.array([[1.0] * 3, [3.0] * 3])
    refined = refinement(weighted_squares, quadratic, shifted)
    _, found = refined(np.eye(3), np.zeros(3), points, weights, 0.0, 3, 10)
    assert found == pytest.approx(weights[:, 0] @ points / weights[:, 0].sum(), abs=1e-4)


def test_a_pose_that_nothing_improves_stays() -> None:
    rotation, translation = np.eye(3), np.ones(3)
    refined = refinement(level, quadratic, shifted)
    points, weights = np.zeros((1, 3)), np.ones((1, 3))
    found = refined(rotation, translation, points, weights, 0.0, 3, 10)
    np.testing.assert_array_equal(found[0], rotation)
    np.testing.assert_array_equal(found[1], translation)
