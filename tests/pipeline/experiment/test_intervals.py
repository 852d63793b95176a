"""Intervals of means over worlds and seeds, against what is known of them."""

import numpy as np
import pytest
from scipy.stats import binom, norm, t

from omninav.pipeline.experiment.intervals import bootstrap_interval, share_interval


def test_equal_figures_a_single_one_and_ratios_that_are_always_the_same_have_an_interval_of_no_width():
    assert bootstrap_interval([np.full(5, 2.5)]) == bootstrap_interval([np.array([2.5])]) == (2.5, 2.5)
    assert bootstrap_interval([np.full(4, 2.0)], [np.full(4, 8.0)]) == (0.25, 0.25)
    assert bootstrap_interval([np.array([]), np.array([3.0])], [np.array([]), np.array([6.0])]) == (0.5, 0.5)
    theirs = [np.array([each]) for each in (1.0, 20.0, 3.0, 40.0, 5.0, 60.0)]  # paired, however much they vary
    assert bootstrap_interval([each / 2 for each in theirs], theirs) == (0.5, 0.5)


@pytest.mark.parametrize("groups", [1, 400])
def test_the_interval_of_a_mean_is_the_normal_one_for_many_values(groups: int):
    values = np.random.default_rng(1).normal(3.0, 2.0, 400)
    low, high = bootstrap_interval(np.split(values, groups))
    half = 1.96 * values.std() / np.sqrt(400)
    assert low == pytest.approx(values.mean() - half, abs=0.012)
    assert high == pytest.approx(values.mean() + half, abs=0.012)


def test_it_misses_the_truth_as_rarely_as_it_says():
    """Six worlds with three seeds in each: more seeds of a world say little of the next world."""
    rng, hits = np.random.default_rng(2), 0
    for _ in range(60):
        groups = rng.normal(0.0, 1.0, (6, 1)) + rng.normal(0.0, 0.3, (6, 3))
        low, high = bootstrap_interval(list(groups))
        hits += low <= 0.0 <= high
    assert 54 <= hits <= 60


@pytest.mark.parametrize("means", [[1.0, 3.0], [1.0, 3.0, 5.0], [1.0, 3.0, 5.0, 7.0, 19.0]])
def test_of_two_to_five_groups_it_is_student_s_of_their_means_however_many_figures_they_have(means: list[float]):
    groups = [np.array([mean - 1.0, mean + 1.0] * 20) for mean in means]
    half = t.ppf(0.975, len(means) - 1) * np.std(means, ddof=1) / np.sqrt(len(means))
    assert bootstrap_interval(groups) == pytest.approx((np.mean(means) - half, np.mean(means) + half))


@pytest.mark.parametrize(
    ("kept", "of", "low", "high"), [(10, 12, 0.552, 0.953), (12, 12, 0.757, 1.0), (0, 6, 0.0, 0.390)]
)
def test_the_interval_of_a_share_is_wilson_s(kept: int, of: int, low: float, high: float):
    """Against the closed form, with z = 1.96."""
    z, share = norm.ppf(0.975), kept / of
    middle, half = share + z**2 / 2 / of, z * np.sqrt(share * (1 - share) / of + z**2 / 4 / of**2)
    closed = ((middle - half) / (1 + z**2 / of), (middle + half) / (1 + z**2 / of))
    assert share_interval(kept, of) == pytest.approx(closed, abs=1e-9)
    assert share_interval(kept, of) == pytest.approx((low, high), abs=1e-3)


def test_a_ratio_to_what_never_varies_varies_as_its_figures_do():
    ours = [np.array([each]) for each in (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)]
    low, high = bootstrap_interval(ours, [np.array([2.0])] * 6)
    assert (2 * low, 2 * high) == pytest.approx(bootstrap_interval(ours))


def test_seeds_that_say_the_same_add_nothing_to_their_world():
    worlds = [1.0, 2.0, 4.0, 8.0, 16.0, 32.0]
    alone = bootstrap_interval([np.array([each]) for each in worlds])
    assert bootstrap_interval([np.full(3, each) for each in worlds]) == pytest.approx(alone)


def test_a_world_with_more_figures_weighs_more():
    """Ten worlds with a 0, ten with two 1: a resample that draws k of these has the mean 2 k / (20 + k)."""
    low, high = bootstrap_interval([np.array([0.0])] * 10 + [np.array([1.0, 1.0])] * 10)
    share = norm.cdf(np.sqrt(20 / 19) * t.ppf(0.025, 19))
    few, many = binom.ppf([share, 1.0 - share], 20, 0.5)
    assert (low, high) == pytest.approx((2 * few / (20 + few), 2 * many / (20 + many)))


def test_its_percentiles_are_student_s_expanded():
    rng = np.random.default_rng(3)
    groups = [rng.normal(0.0, 1.0, 50) for _ in range(20)]
    spread = np.std([group.mean() for group in groups]) / np.sqrt(20)  # what varies within groups is in it already
    low, high = bootstrap_interval(groups)
    assert (high - low) / 2 == pytest.approx(np.sqrt(20 / 19) * t.ppf(0.975, 19) * spread, rel=0.04)


def test_a_ratio_to_worlds_without_error_is_infinite_and_of_nothing_to_nothing_one():
    zeros = [np.zeros(1)] * 6
    assert bootstrap_interval(zeros, zeros) == (1.0, 1.0)
    low, high = bootstrap_interval([np.array([value]) for value in (1.0, 2.0, 1.0, 2.0, 1.0, 2.0)], zeros)
    assert (low, high) == (np.inf, np.inf)
    once = [np.array([value]) for value in (1.0, 0.0, 0.0, 0.0, 0.0, 0.0)]  # many resamples have nothing but zeros
    low, high = bootstrap_interval([np.ones(1)] * 6, once)
    assert low > 1.0
    assert high == np.inf
