"""Variance of profiles that cosine coefficients and principal components keep, worked by hand."""

import numpy as np
import pytest
from measured_drives import figures

from omninav.stages.metrics.profile_components import ProfileComponents, kept
from omninav.stages.values.local_features import VerticalSegments


def showing(coefficients: np.ndarray) -> VerticalSegments:
    """Segments with these coefficients (N, 7) of their profiles, and colours that are not to count."""
    number = len(coefficients)
    colours = np.random.default_rng(0).normal(0.0, 100.0, (number, 3))
    looks = np.concatenate([colours, coefficients], axis=1).astype(np.float32)
    ends = np.zeros((number, 2))
    return VerticalSegments(np.zeros(number), ends, looks, np.ones(number, np.float32), np.zeros((number, 2, 2)))


def measured(*images: np.ndarray | None):
    found = figures(ProfileComponents(), [None if each is None else showing(each) for each in images])
    return found and found["profiles"]


def both_ways(**lengths: float) -> np.ndarray:
    """Two profiles for each coefficient that is named: plus and minus this much of it."""
    rows = np.zeros((2 * len(lengths), 7))
    for row, (name, length) in enumerate(lengths.items()):
        rows[2 * row : 2 * row + 2, int(name[1:]) - 1] = length, -length
    return rows


def test_variance_in_falling_order_of_the_coefficients_leaves_nothing_to_gain() -> None:
    profiles = both_ways(c1=4.0, c2=3.0, c3=2.0)
    found = measured(profiles, profiles)
    assert found["segments"] == 12
    assert found["cosine"] == pytest.approx([16 / 29, 25 / 29, 1.0, 1.0, 1.0, 1.0])
    assert found["principal"] == pytest.approx(found["cosine"])
    assert found["least_ratio"] == pytest.approx(1.0)


def test_components_put_the_largest_first_and_the_worst_number_counts() -> None:
    profiles = both_ways(c1=3.0, c7=4.0)
    found = measured(profiles, None, profiles)
    assert found["cosine"] == pytest.approx([9 / 25] * 6)
    assert found["principal"] == pytest.approx([16 / 25] + [1.0] * 5)
    assert found["least_ratio"] == pytest.approx(9 / 25)


def test_components_are_of_the_first_half_and_judged_on_the_second() -> None:
    found = measured(both_ways(c1=1.0, c2=2.0), both_ways(c1=2.0, c2=1.0))
    assert found["cosine"][0] == pytest.approx(0.8)
    assert found["principal"][0] == pytest.approx(0.2)


def test_the_mean_of_the_first_half_is_no_variance() -> None:
    away = np.full(7, 5.0)
    profiles = both_ways(c1=1.0, c2=2.0)
    found = measured(profiles + away, profiles + away)
    assert found["cosine"][0] == pytest.approx(0.2)
    assert found["principal"][0] == pytest.approx(0.8)


def test_without_two_segments_in_each_half_nothing_is_measured() -> None:
    profiles = both_ways(c1=1.0)
    assert measured(profiles) is None
    assert measured(profiles, profiles[:1]) is None
    assert measured(None, None) is None


def test_profiles_that_are_all_alike_say_nothing() -> None:
    assert measured(np.ones((2, 7)), np.ones((2, 7))) is None


def test_where_components_keep_nothing_coefficients_are_no_worse() -> None:
    found = measured(both_ways(c1=3.0, c2=2.0, c3=1.0), both_ways(c2=1.0))
    assert (found["cosine"][0], found["principal"][0]) == pytest.approx((0.0, 0.0))
    assert found["least_ratio"] == pytest.approx(1.0)


def test_shares_are_summed_from_the_first_column() -> None:
    assert kept(np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])) == pytest.approx([0.5, 1.0])
