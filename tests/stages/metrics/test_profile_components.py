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


@pytest.mark.parametrize(
    ("first", "second", "cosine", "principal"),
    [
        pytest.param(
            {"c1": 4.0, "c2": 3.0, "c3": 2.0},
            {"c1": 4.0, "c2": 3.0, "c3": 2.0},
            [16 / 29, 25 / 29, 1, 1, 1, 1],
            [16 / 29, 25 / 29, 1, 1, 1, 1],
            id="in falling order",
        ),
        pytest.param(
            {"c1": 3.0, "c7": 4.0},
            {"c1": 3.0, "c7": 4.0},
            [9 / 25] * 6,
            [16 / 25, 1, 1, 1, 1, 1],
            id="the largest comes first",
        ),
        pytest.param(
            {"c1": 1.0, "c2": 2.0},
            {"c1": 2.0, "c2": 1.0},
            [0.8, 1, 1, 1, 1, 1],
            [0.2, 1, 1, 1, 1, 1],
            id="of the first half, judged on the second",
        ),
        pytest.param(
            {"c1": 3.0, "c2": 2.0, "c3": 1.0},
            {"c2": 1.0},
            [0, 1, 1, 1, 1, 1],
            [0, 1, 1, 1, 1, 1],
            id="of which the first keeps nothing",
        ),
    ],
)
@pytest.mark.parametrize("away", [0.0, 5.0])  # the mean is no variance
def test_shares_of_variance_and_their_least_ratio(first, second, cosine, principal, away: float) -> None:
    found = measured(both_ways(**first) + away, None, both_ways(**second) + away)
    assert found["segments"] == 2 * len(first) + 2 * len(second)
    assert found["cosine"] == pytest.approx(cosine, abs=1e-6)
    assert found["principal"] == pytest.approx(principal, abs=1e-6)
    ratios = [one / other for one, other in zip(cosine, principal, strict=True) if other]
    assert found["least_ratio"] == pytest.approx(min(ratios))


def test_without_two_segments_in_each_half_nothing_is_measured() -> None:
    profiles = both_ways(c1=1.0)
    assert measured(profiles) is None
    assert measured(profiles, profiles[:1]) is None
    assert measured(None, None) is None


def test_profiles_that_are_all_alike_say_nothing() -> None:
    assert measured(np.ones((2, 7)), np.ones((2, 7))) is None


def test_shares_are_summed_from_the_first_column() -> None:
    assert kept(np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])) == pytest.approx([0.5, 1.0])
