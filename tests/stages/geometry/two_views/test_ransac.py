"""Samples, and how many of them are needed."""

import math

import numpy as np
import pytest

from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.two_views.ransac import BATCH, refined, samples_needed, samples_of


def test_no_row_is_twice_in_a_sample_and_every_row_is_drawn():
    samples = samples_of(12, 5, np.random.default_rng(0))
    assert samples.shape == (BATCH, 5)
    assert all(len(set(sample)) == 5 for sample in samples.tolist())
    assert set(samples.ravel().tolist()) == set(range(12))


@pytest.mark.parametrize(("share", "size"), [(0.5, 2), (0.3, 3), (0.8, 5)])
def test_after_as_many_samples_as_needed_the_chance_of_a_clean_one_is_as_asked(share: float, size: int):
    needed = samples_needed(share, size, 0.99)
    assert 1.0 - (1.0 - share**size) ** needed == pytest.approx(0.99)


def test_without_outliers_one_sample_is_enough_and_without_inliers_none_is():
    assert samples_needed(0.999, 5, 0.99) == 1.0
    assert samples_needed(0.0, 5, 0.99) == math.inf


def shifted(R: Array, t: Array, step: Array) -> tuple[Array, Array]:  # the translation alone is free
    return R, t + step


def weighted_squares(R: Array, t: Array, points: Array, weights: Array, limit: float) -> float:
    return float((weights * (t - points) ** 2).sum())


def quadratic(R: Array, t: Array, points: Array, weights: Array, limit: float, freedoms: int) -> tuple[Array, Array]:
    return weights[:, 0].sum() * np.eye(freedoms), (weights * (t - points)).sum(axis=0)


def level(R: Array, t: Array, points: Array, weights: Array, limit: float) -> float:
    return 1.0


def test_it_finds_the_minimum_of_a_weighted_quadratic() -> None:
    points, weights = np.array([[1.0, 2.0, 3.0], [3.0, -2.0, 5.0]]), np.array([[1.0] * 3, [3.0] * 3])
    by, start = (weighted_squares, quadratic, shifted), (np.eye(3), np.zeros(3))
    # Damped by 0.001, then by a tenth of it: a step leaves 0.001 / 1.001 of the way, the next 0.0001 / 1.0001 of that.
    for steps, left in ((1, 1e-3 / 1.001), (2, 1e-7 / (1.001 * 1.0001)), (10, 0.0)):
        _, found = refined(*by, start, points, weights, 0.0, 3, steps)
        assert found == pytest.approx((1.0 - left) * np.array([2.5, -1.0, 4.5]), rel=1e-10)


def test_a_pose_that_nothing_improves_stays() -> None:
    pose = np.eye(3), np.ones(3)
    points, weights = np.zeros((1, 3)), np.ones((1, 3))
    np.testing.assert_equal(refined(level, quadratic, shifted, pose, points, weights, 0.0, 3), pose)
