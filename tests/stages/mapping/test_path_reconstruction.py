"""Ways between two certain places, against the same problem solved as a whole by least squares."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import least_squares

from omninav.stages.geometry.plane.se2 import chain, compose, wrap
from omninav.stages.mapping.path_reconstruction import reconstruct_path


def root(covariance):
    return np.linalg.inv(np.linalg.cholesky(covariance))


def solved_as_a_whole(first, first_covariance, motions, noise, last, last_covariance):
    start = [first]
    for motion in motions:
        start.append(compose(start[-1], motion))

    def residuals(flat):
        poses = flat.reshape(-1, 3)
        parts = [root(first_covariance) @ off(poses[0], first), root(last_covariance) @ off(poses[-1], last)]
        for k, motion in enumerate(motions):
            cos, sin = math.cos(poses[k, 2]), math.sin(poses[k, 2])
            back = np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])
            parts.append(root(noise[k]) @ (back @ off(poses[k + 1], compose(poses[k], motion))))
        return np.concatenate(parts)

    def off(a, b):
        difference = a - b
        difference[2] = wrap(difference[2])
        return difference

    found = least_squares(residuals, np.ravel(start), xtol=1e-14, ftol=1e-14, gtol=1e-14)
    information = found.jac.T @ found.jac
    blocks = np.linalg.inv(information).reshape(len(start), 3, len(start), 3)
    return found.x.reshape(-1, 3), np.stack([blocks[k, :, k] for k in range(len(start))])


@pytest.fixture
def way():
    rng = np.random.default_rng(3)
    motions = np.column_stack([rng.uniform(0.1, 0.3, 12), rng.normal(0, 0.02, 12), rng.normal(0.1, 0.2, 12)])
    noise = np.stack([np.diag([0.02**2, 0.01**2, 0.05**2])] * 12)
    first, last = np.array([1.0, -2.0, 3.0]), None
    last = compose(first, chain(motions)[-1]) + np.array([0.2, -0.1, 0.1])
    last[2] = wrap(last[2])
    certain = np.diag([0.05**2, 0.05**2, 0.03**2])
    return first, certain, motions, noise, last, certain * 2.0


def assert_alike(found, expected, metres):
    """Means within so many metres, and as many radians; covariances but for the slopes of the noise."""
    means, covariances, _ = found
    np.testing.assert_allclose(means[:, :2], expected[0][:, :2], atol=metres)
    np.testing.assert_allclose(wrap(means[:, 2] - expected[0][:, 2]), 0.0, atol=metres)
    for mine, theirs in zip(covariances, expected[1], strict=True):
        np.testing.assert_allclose(mine, theirs, atol=0.06 * np.abs(theirs).max())


def test_means_and_covariances_are_those_of_the_whole_problem_solved_by_least_squares(way):
    assert_alike(reconstruct_path(*way, rounds=20), solved_as_a_whole(*way), 2e-3)


def test_an_end_that_odometry_reaches_exactly_leaves_the_way_where_odometry_has_it():
    motions = np.array([[0.5, 0.0, 0.3]] * 6)
    first = np.array([0.0, 0.0, 0.0])
    noise = np.stack([np.diag([1e-3, 1e-3, 1e-3])] * 6)
    means, covariances, missed = reconstruct_path(
        first, np.eye(3) * 1e-4, motions, noise, chain(motions)[-1], np.eye(3) * 1e-4
    )
    np.testing.assert_allclose(means, np.vstack([first, chain(motions)]), atol=1e-9)
    assert missed < 1e-12
    traces = np.trace(covariances, axis1=1, axis2=2)
    assert traces.argmax() in (2, 3, 4), "least is known in the middle"


def test_the_distance_missed_is_in_units_of_the_whole_ways_uncertainty():
    motions, noise = np.array([[1.0, 0.0, 0.0]]), np.diag([0.3**2, 1.0, 1.0])[None]
    # 0.5 m missed along a variance of 0.3^2 + 0.4^2 from the ends' x: 0.25 / 0.25.
    ends = np.diag([0.08, 1e-6, 1e-6])
    *_, missed = reconstruct_path(np.zeros(3), ends, motions, noise, np.array([1.5, 0.0, 0.0]), ends)
    assert missed == pytest.approx(1.0, rel=1e-9)


def test_a_way_of_no_motion_is_the_product_of_its_two_ends():
    # Two equal Gaussians 0.2 apart: half way, with half the covariance.
    means, covariances, _ = reconstruct_path(
        np.zeros(3), np.eye(3), np.empty((0, 3)), np.empty((0, 3, 3)), np.array([0.2, 0.0, 0.0]), np.eye(3)
    )
    np.testing.assert_allclose(means, [[0.1, 0.0, 0.0]], atol=1e-12)
    np.testing.assert_allclose(covariances, [np.eye(3) / 2], atol=1e-12)


def test_a_filters_end_that_knows_no_more_than_odometry_says_nothing_of_the_way(way):
    first, certain, motions, noise, *_ = way
    nothing = np.eye(3) * 1e12
    forwards, covariances, _ = reconstruct_path(first, certain, motions, noise, first, nothing, rounds=1)
    means, after, _ = reconstruct_path(first, certain, motions, noise, forwards[-1], covariances[-1], independent=False)
    np.testing.assert_allclose(means, forwards, atol=1e-6)
    np.testing.assert_allclose(after, covariances, rtol=1e-6, atol=1e-12)


def test_what_a_filter_learned_by_its_end_goes_back_along_the_way_as_in_the_whole_problem(way):
    # The whole problem has the measurement; the smoother only the filter's state after it.
    expected = solved_as_a_whole(*way)
    last = expected[0][-1], expected[1][-1]
    assert_alike(reconstruct_path(*way[:4], *last, independent=False, rounds=20), expected, 5e-3)


@given(st.integers(0, 10_000), st.integers(1, 40), st.floats(0.0, 3.0), st.booleans())
def test_covariances_are_positive_definite_and_never_larger_than_forwards_alone(seed, number, gap, independent):
    rng = np.random.default_rng(seed)
    motions = rng.normal(0, [0.3, 0.05, 0.4], (number, 3))
    noise = np.stack([np.diag(rng.uniform(1e-6, 0.1, 3)) for _ in range(number)])
    first, last = rng.normal(0, 1, 3), rng.normal(0, 1, 3) * gap
    start, end = np.diag(rng.uniform(1e-4, 0.5, 3)), np.diag(rng.uniform(1e-4, 5.0, 3))
    means, covariances, _ = reconstruct_path(first, start, motions, noise, last, end, independent=independent)
    assert np.isfinite(means).all()
    assert (np.abs(means[:, 2]) <= math.pi + 1e-12).all()
    np.testing.assert_array_equal(covariances, covariances.transpose(0, 2, 1))
    assert (np.linalg.eigvalsh(covariances) > 0).all()
    assert not independent or (np.linalg.eigvalsh(start - covariances[0]) > -1e-9).all()
