"""The damped least squares of a pose, on a problem with a known solution."""

import numpy as np
import pytest

from omninav.stages.geometry.two_views.refinement import refined


def test_it_finds_the_minimum_of_a_weighted_quadratic() -> None:
    points, weights = np.array([[1.0, 2.0, 3.0], [3.0, -2.0, 5.0]]), np.array([1.0, 3.0])

    def cost(rotation: np.ndarray, translation: np.ndarray) -> float:
        return float(weights @ ((translation - points) ** 2).sum(axis=1))

    def normal_equations(rotation: np.ndarray, translation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return weights.sum() * np.eye(3), weights @ (translation - points)

    def moved(rotation: np.ndarray, translation: np.ndarray, step: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return rotation, translation + step

    _, found = refined((np.eye(3), np.zeros(3)), cost, normal_equations, moved)
    assert found == pytest.approx(weights @ points / weights.sum(), abs=1e-4)


def test_a_pose_that_nothing_improves_stays() -> None:
    start = (np.eye(3), np.ones(3))
    found = refined(
        start, lambda r, t: 1.0, lambda r, t: (np.zeros((3, 3)), np.ones(3)), lambda r, t, step: (r, t + step)
    )
    assert found == start
