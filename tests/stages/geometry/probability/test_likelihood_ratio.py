"""Likelihood ratios learned from scores, against distributions whose ratio is known."""

import math

import numpy as np
import pytest

from omninav.stages.geometry.probability.likelihood_ratio import (
    correlation_length,
    logistic_fit,
    saturated_ratios,
    standard_score,
    standard_scores,
)

RNG = np.random.default_rng(5)


def test_two_gaussians_give_the_slope_and_middle_of_their_ratio():
    # log N(z; 3, 1) / N(z; 1, 1) = 2 z - 4: slope 2, middle 2.
    scores = np.concatenate([RNG.normal(3, 1, 20_000), RNG.normal(1, 1, 40_000)])
    right = np.arange(60_000) < 20_000
    slope, middle = logistic_fit(scores, np.where(right, 1 / 20_000, 1 / 40_000) * 1000, right)
    assert slope == pytest.approx(2.0, rel=0.05)
    assert middle == pytest.approx(2.0, abs=0.05)
    # At 0 the odds are 2 to 3, at 1 they are 3 to 2.
    found = logistic_fit(np.array([0.0, 1.0, 0.0, 1.0]), np.array([3e3, 2e3, 2e3, 3e3]), np.arange(4) >= 2)
    assert found == pytest.approx((2.0 * math.log(1.5), 0.5), rel=1e-5)


def test_examples_that_a_score_separates_give_a_finite_slope_and_reversed_ones_none():
    scores, right = np.array([0.0, 1.0, 2.0, 3.0]), np.array([False, False, True, True])
    slope, middle = logistic_fit(scores, np.ones(4), right)
    assert math.isfinite(slope)
    assert slope > 5.0
    assert middle == pytest.approx(1.5, abs=0.1)
    assert logistic_fit(scores, np.ones(4), ~right) == (0.0, 0.0)


def test_a_ratio_is_bounded_below_by_the_outliers_and_grows_slowly_above_the_images():
    scores = np.array([-5.0, 1.0, 5.0, 6.0], np.float32)
    found = saturated_ratios(scores, 4.0, 1.0, 0.1, 200).astype(np.float64)
    assert found[0] == pytest.approx(0.1, rel=1e-3)
    assert found[1] == pytest.approx(1.0 / (1 + (1 / 200) ** 0.6), rel=1e-4)
    assert math.log(found[3] / found[2]) == pytest.approx(4.0 * 0.4, rel=1e-3)


def test_scores_do_not_change_where_light_makes_all_similarities_smaller_by_one_power_and_factor():
    values = RNG.uniform(0.2, 0.9, (50, 12)).astype(np.float32)
    assert np.allclose(standard_scores(0.5 * values**1.7), standard_scores(values), atol=1e-3)
    assert np.allclose(standard_scores(values).max(axis=1).std(), 1.0, atol=1e-3)
    best = np.array([np.exp(-1.0), np.exp(-5.0)], np.float32)  # logarithms about -3, a standard deviation of 2
    assert [standard_score(each, best) for each in (np.exp(-2.0), 0.0)] == pytest.approx(
        [0.5, math.log(1e-6) / 2 + 1.5]
    )
    assert standard_scores(np.array([[np.exp(-1.0)], [0.0]], np.float32))[:, 0] == pytest.approx([1.0, -1.0])


def test_references_that_stand_for_several_count_as_several():
    values = RNG.uniform(0.2, 0.9, (6, 4)).astype(np.float32)
    each = np.array([1.0, 3.0, 1.0, 1.0, 2.0, 1.0])
    repeated = np.repeat(values, each.astype(int), axis=0)
    expected = standard_scores(repeated)[np.cumsum(each.astype(int)) - 1]
    assert np.allclose(standard_scores(values, each), expected, atol=1e-5)


def test_the_length_of_a_correlated_series_is_found():
    # Of 19 neighbours 3 differ: exp(-1 / l) = (16 - 3) / 19. Lengths up to that between the ends are tried.
    values, steps = np.repeat([5.0, 1.0, 5.0, 1.0], 5), np.arange(20.0)
    places, apart = np.column_stack([steps, 0.0 * steps]), np.abs(steps[:, None] - steps)
    found = correlation_length(values, places, (apart == 1.0) | (apart == 19.0))
    assert found == pytest.approx(-1.0 / math.log(13 / 19), rel=0.03)
    assert correlation_length(values, places) == correlation_length(values, places, apart < 99.0) < 3.0
    assert correlation_length(np.ones(20), places) is None
    assert correlation_length(values[3:8], places[3:8]) is not None  # ten pairs
    assert correlation_length(values[3:7], places[3:7]) is None
