"""Matches against a search by hand and against kd-trees; visual distance against its equation worked by hand."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omninav.stages.geometry.appearance.feature_matching import (
    mahalanobis_matches,
    mutual_nearest,
    squared_distances,
    tree_matches,
)
from omninav.stages.geometry.appearance.visual_distance import (
    ComparisonOptions,
    Patches,
    ViewFeatures,
    alignment,
    compare,
    local_distance,
    match_patches,
)
from omninav.stages.values.local_features import LocalFeatures, view_features


def by_hand(squares: np.ndarray, ratio: float) -> set[tuple[int, int]]:
    found = set()
    for i, row in enumerate(squares):
        j = int(row.argmin())
        column = squares[:, j]
        others = [*np.delete(row, j), *np.delete(column, i)]
        if column.argmin() == i and (not others or row[j] < ratio**2 * min(others)):
            found.add((i, j))
    return found


@given(st.integers(0, 10**6), st.integers(1, 30), st.integers(1, 30), st.floats(0.3, 1.0))
def test_matches_are_mutual_and_nearer_than_the_second_by_the_ratio(seed: int, n: int, m: int, ratio: float) -> None:
    squares = np.random.default_rng(seed).random((n, m)).astype(np.float32)
    pairs = mutual_nearest(squares, ratio)
    assert set(zip(pairs.first.tolist(), pairs.second.tolist(), strict=True)) == by_hand(squares, ratio)
    rest = squares.copy()
    rest[pairs.first, pairs.second] = np.inf
    rivals = np.minimum(rest.min(axis=1)[pairs.first], rest.min(axis=0)[pairs.second])
    assert (np.diff(squares[pairs.first, pairs.second] / rivals) >= -1e-6).all()  # the clearest first
    assert pairs.distance == pytest.approx(np.sqrt(squares[pairs.first, pairs.second]))


def test_squared_distances_of_descriptors_are_exact() -> None:
    a, b = np.random.default_rng(0).integers(0, 256, (2, 40, 128), dtype=np.uint8)
    exact = ((a[:, None].astype(int) - b[None].astype(int)) ** 2).sum(axis=-1)
    assert (squared_distances(a, b) == exact).all()


def test_a_kd_tree_finds_the_same_pairs() -> None:
    rng = np.random.default_rng(4)
    a = rng.normal(size=(80, 10))
    b = np.concatenate([a[:50] + 0.3 * rng.normal(size=(50, 10)), rng.normal(size=(40, 10))])
    all_of, tree = mutual_nearest(squared_distances(a, b), 0.8), tree_matches(a, b, 0.8)
    assert len(tree.first) > 30
    assert (tree.first == all_of.first).all()
    assert (tree.second == all_of.second).all()
    assert len(tree_matches(a, b[:0], 0.8).first) == 0


def test_who_has_two_partners_that_look_the_same_has_none() -> None:
    one = np.array([[1.0, 2.0], [5.0, 5.0]], np.float32)
    other = np.array([[1.0, 2.0], [1.0, 2.0], [5.0, 5.5]], np.float32)
    for found in (mutual_nearest(squared_distances(one, other), 0.8), tree_matches(one, other, 0.8)):
        assert list(zip(found.first.tolist(), found.second.tolist(), strict=True)) == [(1, 2)]


def test_a_partner_that_was_mapped_twice_is_one_and_a_second_one_elsewhere_is_a_rival() -> None:
    squares = np.array([[0.1, 0.1, 0.9], [0.8, 0.7, 0.1]], np.float32)
    for rival, found in (((0.05, 0.0, 0.0), [(0, 0), (1, 2)]), ((0.2, 0.0, 0.0), [(1, 2)])):
        pairs = mutual_nearest(squares, 0.8, np.array([(0.0, 0.0, 0.0), rival, (3.0, 0.0, 0.0)]))
        assert sorted(zip(pairs.first.tolist(), pairs.second.tolist(), strict=True)) == found


def test_elements_count_by_their_spread_and_one_that_never_varies_not_at_all() -> None:
    rng = np.random.default_rng(2)
    one = rng.normal(size=(30, 4)).astype(np.float32)
    one[:, 3] = 5.0
    other = one[::-1] + 0.1 * rng.normal(size=(30, 4)).astype(np.float32)
    other[:, 3] = 5.0
    scaled = mahalanobis_matches(one * np.float32([1, 1000, 1, 1]), other * np.float32([1, 1000, 1, 1]), 0.8)
    plain = mahalanobis_matches(one, other, 0.8)
    assert plain.distance == pytest.approx(scaled.distance, rel=1e-2)
    assert (plain.second == 29 - plain.first).all()
    sigma = np.concatenate([one, other]).std(axis=0)
    gap = ((one - other[::-1]) / np.where(sigma > 0, sigma, 1.0))[plain.first]
    assert plain.distance == pytest.approx(np.linalg.norm(gap, axis=1), rel=1e-2)  # equation 2


def test_patches_are_compared_by_equation_2_where_that_is_asked_for() -> None:
    # The first element spreads by 100 and the second by 1. As they are, row 0 is nearest to column 0 by the first
    # element, and by equation 2 to column 1, whose second element is its own: worked out below.
    one, other = np.float32([[100, 0], [-100, 9]]), np.float32([[101, 3], [90, 0], [-120, 9]])
    sigma = np.concatenate([one, other]).std(axis=0)
    assert sigma == pytest.approx([101.68, 4.069], rel=1e-3)
    squares = (((one[:, None] - other) / sigma) ** 2).sum(axis=-1)
    assert squares[0] == pytest.approx([0.5436, 0.00967, 9.573], rel=1e-3)
    first, second = (Patches(rows, np.zeros((len(rows), 3), np.float32), np.zeros(len(rows))) for rows in (one, other))
    plain = match_patches(first, second, ComparisonOptions())
    assert dict(zip(plain.first.tolist(), plain.second.tolist(), strict=True)) == {0: 0, 1: 2}
    for search in ("all", "kd_tree"):
        scaled = match_patches(first, second, ComparisonOptions(search=search, patch_distance="mahalanobis"))
        assert dict(zip(scaled.first.tolist(), scaled.second.tolist(), strict=True)) == {0: 1, 1: 2}
        assert scaled.distance[scaled.first == 0] == pytest.approx(math.sqrt(0.00967), rel=1e-3)


def test_the_measure_is_equation_4_worked_by_hand() -> None:
    angles = np.array([0.3, 0.5, 0.3, 0.5])  # aligned by 0.4: 0.1 rad left on average
    distance, turn = local_distance(angles, 30, 50, ComparisonOptions(min_matches=2, min_angle=0.0))
    assert distance == pytest.approx((30 + 50) * 0.4 / (2.0 * math.pi) / (2 * 4**2))
    assert turn == pytest.approx(0.4)


def test_one_match_is_no_perfect_match_and_none_is_infinitely_far() -> None:
    measure = ComparisonOptions(min_matches=3, min_angle=0.01)
    assert local_distance(np.array([0.2, 0.2]), 10, 10, measure)[0] == math.inf
    assert local_distance(np.empty(0), 10, 10, ComparisonOptions(min_matches=0, min_angle=0.01))[0] == math.inf
    floor = 2 * 4 / 4 * 0.01 / (2.0 * math.pi)  # that of the angle
    assert local_distance(np.full(4, 0.2), 8, 8, measure)[0] == pytest.approx(floor)


def test_alignment_goes_around_the_circle() -> None:
    mean, left = alignment(np.array([math.pi - 0.1, -math.pi + 0.3]))
    assert abs(mean) == pytest.approx(math.pi - 0.1)
    assert sorted(left) == pytest.approx([-0.2, 0.2])


def ready(azimuths: np.ndarray, seed: int = 0) -> ViewFeatures:
    number = len(azimuths)
    bearings = np.stack([np.cos(azimuths), np.sin(azimuths), np.zeros(number)], axis=-1)
    looks = np.random.default_rng(seed).integers(0, 120, (number, 128), dtype=np.uint8)
    grey = np.zeros((number, 3), np.float32)
    patches = LocalFeatures(bearings, np.zeros((number, 2)), looks, grey, np.ones(number, np.float32))
    return view_features(patches)


@given(st.floats(-3.1, 3.1))
def test_a_robot_turned_on_the_spot_is_at_no_distance_and_its_turn_is_told(turn: float) -> None:
    around = np.linspace(-3.0, 3.0, 40)
    compared = compare(ready(around), ready(around - turn), ComparisonOptions(min_angle=0.0))
    assert compared.matches == 40
    assert compared.distance == pytest.approx(0.0, abs=1e-6)
    assert math.cos(compared.turn - turn) == pytest.approx(1.0)


def test_colours_part_what_looks_alike_in_grey() -> None:
    around = np.linspace(-3.0, 3.0, 20)
    one, other = ready(around), ready(around)
    other.patches.colours[::2] = 0.9
    assert compare(one, other, ComparisonOptions()).matches == 10
    assert compare(one, other, ComparisonOptions(max_colour_distance=9.0)).matches == 20
    assert compare(one, other, ComparisonOptions(search="kd_tree")).matches == 10
    assert compare(one, ViewFeatures(None, None), ComparisonOptions()).distance == math.inf
