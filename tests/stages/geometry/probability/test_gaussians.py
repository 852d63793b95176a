"""Gaussians over poses, against scipy, numpy's own inverses, plain loops and identities.

Errata are numbered as in docs/papers.md.
"""

import itertools
import math
from random import Random

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from made_mixtures import Mixture, covariances, drawn_mixture, gap, half_a_turn_apart, mixtures
from scipy.stats import multivariate_normal

from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.geometry.probability.gaussians import (
    density,
    drawn,
    floored,
    intersected,
    inverse_into,
    merged,
    moments,
    squared_distances,
)

UNIT = np.eye(3)
headings = st.floats(-math.pi, 3.14)


# densities


@given(mixtures(), st.floats(-3, 3), headings)
def test_the_density_is_scipys_at_the_shorter_turn(mixture: Mixture, x: float, heading: float) -> None:
    point = np.array([x, 0.3, heading])
    assume(not half_a_turn_apart(mixture[0], point[None]))
    wanted = sum(
        weight * multivariate_normal(np.zeros(3), covariance).pdf(gap(mean, point))
        for mean, covariance, weight in zip(*mixture, strict=True)
    )
    found = density(np.stack([point, point - [0.0, 0.0, 4 * math.pi]]), *mixture)
    assert found == pytest.approx([wanted, wanted], rel=1e-9, abs=1e-11)


def test_the_density_is_in_one_over_square_metres_and_radians() -> None:
    # Erratum 14: at its mean 1 / ((2 pi)^1.5 sigma_x sigma_y sigma_heading), so that a threshold on it has a unit.
    points = np.diag([0.0, 0.3 * 8.99, 0.1 * 9.01])  # beyond nine sigma there is none
    found = density(points, np.zeros((1, 3)), np.diag([0.04, 0.09, 0.01])[None], np.ones(1))
    top = 1 / ((2 * math.pi) ** 1.5 * 0.2 * 0.3 * 0.1)
    assert found == pytest.approx([top, top * math.exp(-0.5 * 8.99**2), 0.0], rel=1e-9, abs=0.0)


def test_no_component_no_density() -> None:
    assert density(np.zeros((2, 3)), np.zeros((0, 3)), np.zeros((0, 3, 3)), np.zeros(0)).tolist() == [0.0, 0.0]


# distances


@given(mixtures(), mixtures())
def test_squared_distances_are_those_of_a_plain_loop(a: Mixture, b: Mixture) -> None:
    assume(not half_a_turn_apart(a[0], b[0]))
    found, back = squared_distances(*a[:2], *b[:2]), squared_distances(*b[:2], *a[:2])
    for i, j in itertools.product(range(len(a[0])), range(len(b[0]))):
        apart = gap(a[0][i], b[0][j])
        assert found[i, j] == pytest.approx(apart @ np.linalg.solve(a[1][i] + b[1][j], apart), rel=1e-6, abs=1e-12)
    assert np.allclose(back.T, found, rtol=1e-6, atol=1e-12)


def test_places_without_doubt_are_at_no_distance_from_themselves_and_far_from_others() -> None:
    means, none = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]), np.zeros((2, 3, 3))
    found = squared_distances(means, none, means, none)
    assert found[0, 0] == 0.0
    assert found[0, 1] > 1e200


# moments


def test_moments_worked_by_hand() -> None:
    # Weights 3 and 1, x at 0 and 4: mean 1, spread (3 * 1 + 1 * 9) / 4 = 3 on top of the mean covariance (3 + 5) / 4.
    # Erratum 7: equation 13 as printed does not divide by the sum of weights, and moves the mean to 4.
    # Erratum 16: without that spread, the merged Gaussian is more certain than the pair.
    means = np.array([[0.0, 0.0, 0.0], [4.0, 2.0, 0.0]])
    parts = np.stack([np.diag([1.0, 1.0, 1.0]), np.diag([5.0, 1.0, 1.0])])
    mean, covariance, total = moments(means, parts, np.array([3.0, 1.0]))
    assert (*mean, total) == pytest.approx((1.0, 0.5, 0.0, 4.0))
    assert covariance == pytest.approx(np.array([[5.0, 1.5, 0.0], [1.5, 1.75, 0.0], [0.0, 0.0, 1.0]]))
    _, without, _ = merged(means, parts, np.array([3.0, 1.0]), 1e9, spread=False)
    assert without == pytest.approx(np.diag([2.0, 1.0, 1.0])[None])


def test_the_mean_heading_of_two_beside_the_seam_is_at_the_seam() -> None:
    means = np.array([[0, 0, math.pi - 0.1], [0, 0, -math.pi + 0.1]])
    mean, covariance, _ = moments(means, np.zeros((2, 3, 3)), np.ones(2))
    assert abs(mean[2]) == pytest.approx(math.pi)
    assert covariance[2, 2] == pytest.approx(0.01)


def test_without_any_weight_all_count_alike() -> None:
    mean, _, total = moments(np.array([[0.0, 0, 0], [2.0, 0, 0]]), np.stack([UNIT, UNIT]), np.zeros(2))
    assert mean[0] == pytest.approx(1.0)
    assert total == 0.0


# merging


def one_of(means: np.ndarray, covariances: np.ndarray, weights: np.ndarray, spread: bool):
    mean, covariance, total = moments(means, covariances, weights)
    return mean, covariance if spread else np.average(covariances, axis=0, weights=weights), total


def merged_plainly(mixture: Mixture, limit: float, spread: bool) -> Mixture:
    """The closest pair first, by looking at all pairs each time."""
    parts = list(zip(*mixture, strict=True))
    while len(parts) > 1:
        found = {
            (i, j): gap(a[0], b[0]) @ np.linalg.solve(a[1] + b[1], gap(a[0], b[0]))
            for (i, a), (j, b) in itertools.combinations(enumerate(parts), 2)
        }
        i, j = min(found, key=lambda pair: found[pair])
        if found[i, j] >= limit:
            break
        pair = [np.stack([parts[i][k], parts[j][k]]) for k in range(3)]
        parts = [part for k, part in enumerate(parts) if k not in (i, j)] + [one_of(*pair, spread)]
    means, parts_covariances, weights = (np.stack(each) for each in zip(*parts, strict=True))
    return means, parts_covariances, weights


def by_place(mixture: Mixture) -> list[np.ndarray]:
    order = np.lexsort(mixture[0].T)
    return [each[order] for each in mixture]


@pytest.mark.parametrize("spread", [True, False])
@pytest.mark.parametrize("limit", [0.5, 3.0, 20.0])
def test_merging_takes_the_closest_pair_first_like_a_plain_loop(limit: float, spread: bool) -> None:
    rng = np.random.default_rng(2)
    for number in (2, 5, 12, 25):
        mixture = drawn_mixture(rng, number, extent=0.7)
        found, wanted = (
            by_place(each) for each in (merged(*mixture, limit, spread), merged_plainly(mixture, limit, spread))
        )
        assert len(found[0]) == len(wanted[0])
        assert all(np.allclose(a, b, atol=1e-9) for a, b in zip(found, wanted, strict=True))


@given(mixtures(most=10, extent=0.6), st.randoms(use_true_random=False), st.sampled_from([0.3, 2.0, 8.0]))
def test_the_order_of_the_input_changes_nothing_at_all(mixture: Mixture, random: Random, limit: float) -> None:
    order = list(range(len(mixture[2])))
    random.shuffle(order)
    here = merged(*mixture, limit, shares=mixture[2] * 0.5)
    there = merged(*(each[order] for each in mixture), limit, shares=(mixture[2] * 0.5)[order])
    assert all(np.array_equal(a, b) for a, b in zip(here, there, strict=True))


@given(mixtures(most=10, extent=0.6))
def test_merging_keeps_the_weight_and_the_first_two_moments_of_place(mixture: Mixture) -> None:
    found = merged(*mixture, 5.0, shares=np.arange(len(mixture[2])) * 1.0)
    before, after = moments(*mixture), moments(*found[:3])
    assert after[2] == pytest.approx(before[2])
    assert after[0][:2] == pytest.approx(before[0][:2], abs=1e-12)
    assert after[1][:2, :2] == pytest.approx(before[1][:2, :2], abs=1e-12)
    assert found[3].sum() == pytest.approx(np.arange(len(mixture[2])).sum())
    assert np.linalg.eigvalsh(found[1]).min() > 0.0
    apart = squared_distances(found[0], found[1], found[0], found[1])
    assert (apart[~np.eye(len(apart), dtype=bool)] >= 5.0).all()


def test_of_three_in_a_row_the_two_closest_become_one() -> None:
    # 0, 1.0 and 1.9 with variances of 0.5: squared distances 1 and 0.81. The first stays alone: 1.45^2 / 1.2 > 1.1.
    means = np.array([[0.0, 0, 0], [1.0, 0, 0], [1.9, 0, 0]])
    for order in itertools.permutations(range(3)):
        found = merged(means[list(order)], np.stack([0.5 * UNIT] * 3), np.ones(3), 1.1)
        assert found[0][:, 0] == pytest.approx([0.0, 1.45])
        assert found[2].tolist() == [1.0, 2.0]


def test_counts_average_and_weights_add_up() -> None:
    # Equations 13 and 14: eta 3 and 1 average places, w 0.7 and 0.6 are summed; capping at 1 is the map's (erratum 8).
    means = np.array([[0.0, 0, 0], [0.4, 0, 0]])
    found = merged(means, np.stack([UNIT, UNIT]), np.array([3.0, 1.0]), 1.0, shares=np.array([0.7, 0.6]))
    assert found[0][0] == pytest.approx([0.1, 0, 0])
    assert found[2] == pytest.approx([4.0])
    assert found[3] == pytest.approx([1.3])


def test_merging_writes_to_nothing_it_was_given() -> None:
    mixture = drawn_mixture(np.random.default_rng(3), 20, 0.3)
    before = [each.copy() for each in mixture]
    merged(*mixture, 8.0)
    assert merged(*mixture, 0.0)[2].tolist() == sorted(mixture[2], reverse=True)  # the heaviest first
    assert all(np.array_equal(a, b) for a, b in zip(mixture, before, strict=True))


# intersection


@given(mixtures(most=2, least=2), st.floats(0, 1))
def test_an_intersection_is_equations_3_and_4_with_their_inverses(mixture: Mixture, alpha: float) -> None:
    (a, b), (cov_a, cov_b), _ = mixture
    assume(not half_a_turn_apart(a[None], b[None]))
    mean, covariance = intersected(a, cov_a, b, cov_b, alpha)
    near = a + gap(a, b)
    first, second = (1 - alpha) * np.linalg.inv(cov_a), alpha * np.linalg.inv(cov_b)
    wanted = np.linalg.inv(first + second)
    assert covariance == pytest.approx(wanted, rel=1e-6, abs=1e-12)
    assert inverse_into(cov_a, covariance) == pytest.approx(np.linalg.slogdet(cov_a)[1])
    assert np.abs(gap(mean, wanted @ (first @ a + second @ near))).max() < 1e-7


def test_equal_covariances_stay_and_equal_means_do_not_move() -> None:
    # Errata 2 and 4: as printed, 4 I and 4 I gave 0.25 I and another mean; Kalman's would be 2 I.
    pose = np.array([3.0, -2.0, 1.0])
    mean, covariance = intersected(pose, 4 * UNIT, pose, 4 * UNIT, 0.3)
    assert covariance == pytest.approx(4 * UNIT)
    assert mean == pytest.approx(pose)


def test_what_is_no_covariance_is_refused() -> None:
    with pytest.raises(ValueError, match="not positive definite"):
        intersected(np.zeros(3), UNIT, np.zeros(3), -UNIT, 0.5)
    with pytest.raises(ValueError, match="not positive definite"):
        density(np.zeros((1, 3)), np.zeros((1, 3)), np.zeros((1, 3, 3)), np.ones(1))


# draws and floors


def test_draws_have_the_moments_of_the_mixture_and_wrapped_headings() -> None:
    rng = np.random.default_rng(4)
    means = np.array([[0.0, 0.0, 3.1], [5.0, 1.0, -3.1], [9.0, 9.0, 0.0]])
    parts = np.stack([np.diag([0.04, 0.01, 0.02])] * 3)
    points = drawn(means, parts, np.array([0.75, 0.25, 0.0]), 40_000, rng)
    assert points[:, 2].min() >= -math.pi
    assert points[:, 2].max() < math.pi
    first = points[:, 0] < 2.5
    assert first.mean() == pytest.approx(0.75, abs=0.01)
    assert not (points[:, 1] > 5).any()
    assert points[first, 0].std() == pytest.approx(0.2, rel=0.02)
    assert wrap(points[first, 2] - 3.1).std() == pytest.approx(math.sqrt(0.02), rel=0.02)


def test_a_mixture_without_weight_gives_no_draws() -> None:
    with pytest.raises(ValueError, match="without weight"):
        drawn(np.zeros((1, 3)), UNIT[None], np.zeros(1), 5, np.random.default_rng(0))


@given(covariances(), st.floats(0.01, 1.0), st.floats(0.01, 1.0))
def test_a_floor_holds_in_every_direction_and_changes_nothing_above_it(
    covariance: np.ndarray, metres: float, radians: float
) -> None:
    least = np.diag([metres, metres, radians]) ** 2
    found = floored(covariance, (metres, metres, radians))
    assert np.linalg.eigvalsh(found - least).min() > -1e-12
    assert np.linalg.eigvalsh(found - covariance).min() > -1e-12
    assert np.array_equal(found, found.T)
    above = floored(covariance + least, (metres, metres, radians))
    assert np.array_equal(above, covariance + least)


def test_a_floor_raises_none_and_less_than_none() -> None:
    low = np.array([np.zeros((3, 3)), np.diag([1.0, -1e-12, 1.0])])
    found = floored(low, (0.1, 0.1, 0.02))
    assert found[0] == pytest.approx(np.diag([0.01, 0.01, 0.0004]))
    assert found[1] == pytest.approx(np.diag([1.0, 0.01, 1.0]))
