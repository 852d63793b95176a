import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from view_at_turn import turned_view

from omninav.stages.geometry.appearance.best_segments import sorting_network
from omninav.stages.geometry.appearance.segments import (
    cosine_similarities,
    euclidean_similarities,
    penalties,
    similarities,
    similarity_at,
    turned_views,
)

RNG = np.random.default_rng(0)


def histograms(number: int, segments: int, bins: int, seed: int = 0) -> np.ndarray:
    values = np.random.default_rng(seed).random((number, segments, bins)).astype(np.float32) ** 4
    return values / values.sum(axis=2, keepdims=True)


def score(alike: np.ndarray, exponent: float = 0.5) -> float:
    """The paper's S by its words: rank, then try every k."""
    n, ranked = len(alike), sorted(alike, reverse=True)
    return max(sum(ranked[:k]) * k**-exponent * n ** (exponent - 1) for k in range(1, n + 1))


@pytest.mark.parametrize("segments", [5, 10, 36])
@pytest.mark.parametrize("headings", [1, 12, 36])
def test_the_kernel_agrees_with_the_paper_s_words(segments: int, headings: int) -> None:
    references, view = histograms(6, segments, 20), histograms(1, segments, 20, seed=1)[0]
    found = similarities(references, view, headings, "histograms")
    for h in range(headings):
        shift = h * segments / headings
        whole, part = int(shift), shift - int(shift)
        turned = [
            (1 - part) * view[(j + whole) % segments] + part * view[(j + whole + 1) % segments] for j in range(segments)
        ]
        for r, reference in enumerate(references):
            alike = np.array([np.minimum(a, b).sum() for a, b in zip(turned, reference, strict=True)])
            assert found[r, h] == pytest.approx(score(alike), abs=2e-6)


def test_colours_are_compared_by_their_distance() -> None:
    references = (RNG.random((4, 9, 3)) * 255).astype(np.float32)
    view = (RNG.random((9, 3)) * 255).astype(np.float32)
    alike = 1 - np.linalg.norm(references - view, axis=2) / (np.sqrt(3) * 255)
    selective = similarities(references, view, 9, "colours")[:, 0]
    plain = similarities(references, view, 9, "colours", None)[:, 0]
    assert np.allclose(selective, [score(a) for a in alike], atol=1e-6)
    assert np.allclose(plain, alike.mean(axis=1), atol=1e-6)


def test_colours_farther_apart_than_the_scale_are_not_alike_at_all() -> None:
    references, view = np.full((1, 4, 3), 100, np.float32), np.full((4, 3), 100, np.float32)
    view[:, 0] += [0, 15, 30, 90]
    assert similarities(references, view, 1, "colours", None, max_distance=60.0)[0, 0] == pytest.approx(2.25 / 4)
    # s = 1, 3/4, 1/2, 0: three segments, (9/4) / sqrt(3 x 4) = .65, beat four and two.
    found = similarities(references, view, 1, "colours", max_distance=60.0)[0, 0]
    assert found == pytest.approx(2.25 / np.sqrt(12), abs=1e-6)


def with_segment_similarities(alike: list[float]) -> tuple[np.ndarray, np.ndarray]:
    """Two views whose segments' histogram intersections are the given numbers."""
    expected = np.array([[[s, 1 - s, 0] for s in alike]], np.float32)
    observed = np.array([[s, 0, 1 - s] for s in alike], np.float32)
    return expected, observed


@pytest.mark.parametrize(("n", "k"), [(10, 1), (10, 4), (10, 10), (5, 2)])
def test_k_perfect_segments_of_n_give_the_root_of_k_over_n(n: int, k: int) -> None:
    # Erratum 20, worked by hand.
    expected, observed = with_segment_similarities([1.0] * k + [0.0] * (n - k))
    assert similarities(expected, observed, 1, "histograms")[0, 0] == pytest.approx(np.sqrt(k / n), abs=1e-6)


def test_all_k_are_tried_because_the_score_dips_on_its_way_up() -> None:
    # Erratum 21: s = (1, .41, .41, .41, .41) has S(1) = .447, dips at k = 2, and ends at S(5) = .528.
    expected, observed = with_segment_similarities([1.0, 0.41, 0.41, 0.41, 0.41])
    assert similarities(expected, observed, 1, "histograms")[0, 0] == pytest.approx(0.528, abs=1e-6)
    assert 1.41 * np.sqrt(1 / 10) < 1.0 * np.sqrt(1 / 5)


@pytest.mark.parametrize("exponent", [0.0, 1 / 3, 0.5])
@pytest.mark.parametrize("segments", [1, 7, 36])
def test_similarities_stay_within_zero_and_one_and_a_view_is_wholly_like_itself(segments: int, exponent: float) -> None:
    # Erratum 20: bounded because each segment's histogram sums to 1.
    references = histograms(30, segments, 20)
    references[10:20, :, 1:] = 0  # one bin holds all
    references[10:20, :, 0] = 1
    for view in (references[0], references[15]):
        found = similarities(references, view, 36, "histograms", exponent)
        assert found.min() >= 0.0
        assert found.max() <= 1.0
        assert found[[0, 15][int(view[0, 0] == 1)], 0] == pytest.approx(1.0, abs=1e-5)


@given(st.integers(1, 70), st.integers(0, 2**32 - 1))
def test_the_network_sorts(length: int, seed: int) -> None:
    items = list(np.random.default_rng(seed).random(length))
    wanted = sorted(items)
    for i, j in sorting_network(length):
        if items[i] > items[j]:
            items[i], items[j] = items[j], items[i]
    assert items == wanted


def test_a_penalty_without_exponent_is_the_mean_of_all() -> None:
    references, view = histograms(3, 10, 20), histograms(1, 10, 20, seed=2)[0]
    none = similarities(references, view, 10, "histograms", exponent=0.0)
    assert np.allclose(none, similarities(references, view, 10, "histograms", None), atol=1e-6)
    assert np.allclose(penalties(10, 0.0), 0.1)


@pytest.mark.parametrize("turn", [1, 4, 17])
def test_a_robot_turned_left_is_found_at_the_heading_it_turned_by(turn: int) -> None:
    # Erratum 24: the reference's own view, with the scene moved to the right, is the view after a left turn.
    reference = histograms(1, 18, 20)
    turned = np.roll(reference[0], turn, axis=0)
    for found in (
        similarities(reference, turned, 18, "histograms"),
        euclidean_similarities(reference, turned, 18, "histograms"),
    ):
        assert int(np.argmax(found[0])) == turn
        assert found[0, turn] == pytest.approx(1.0, abs=2e-4)


def test_a_fraction_of_a_segment_is_the_mixture_of_two() -> None:
    view = histograms(1, 10, 20)[0]
    turned = turned_views(view, 36)[1]  # 10 degrees of 36 per segment
    assert np.allclose(turned, (1 - 10 / 36) * view + 10 / 36 * np.roll(view, -1, axis=0), atol=1e-6)
    assert np.allclose(turned.sum(axis=1), 1.0, atol=1e-6)
    assert np.allclose(turned_view(view, -2 * np.pi / 36), turned, atol=1e-5)


def test_one_heading_each_agrees_with_all_headings() -> None:
    references, view = histograms(5, 12, 20), histograms(1, 12, 20, seed=3)[0]
    everywhere = similarities(references, view, 12, "histograms")
    picked = np.array([0, 3, 5, 11, 7])
    one = similarity_at(references, view, 2 * np.pi * picked / 12, "histograms")
    assert np.allclose(one, everywhere[np.arange(5), picked], atol=1e-5)


def test_chosen_references_are_compared_as_all_are() -> None:
    references, view = histograms(9, 10, 20), histograms(1, 10, 20, seed=4)[0]
    chosen = np.array([1, 4, 8])
    for compare in (
        lambda c: similarities(references, view, 36, "histograms", chosen=c),
        lambda c: euclidean_similarities(references, view, 36, "histograms", c),
    ):
        assert np.allclose(compare(chosen), compare(None)[chosen], atol=1e-6)


def test_distances_of_whole_views_agree_with_numpy() -> None:
    references, view = histograms(5, 8, 20), histograms(1, 8, 20, seed=6)[0]
    found = euclidean_similarities(references, view, 8, "histograms")
    gap = np.linalg.norm((references - view).reshape(5, -1), axis=1)
    assert np.allclose(found[:, 0], 1 - gap / np.sqrt(16), atol=1e-4)


def test_the_cosine_is_that_of_whole_views_whatever_their_length() -> None:
    references = np.array([[[1, 0], [0, 0]], [[0, 0], [3, 0]], [[-1, 0], [0, 0]], [[0, 0], [0, 0]]], np.float32)
    view = np.array([[2, 0], [0, 0]], np.float32)
    found = cosine_similarities(references, view, 2)
    np.testing.assert_allclose(found, [[1, 0], [0, 1], [0, 0], [0, 0]], atol=1e-6)
    np.testing.assert_array_equal(cosine_similarities(references, view, 2, np.array([1])), found[1:2])


def test_unit_vectors_that_point_away_from_each_other_are_as_far_apart_as_can_be() -> None:
    references = np.array([[[1, 0]], [[-1, 0]]], np.float32)
    np.testing.assert_allclose(euclidean_similarities(references, references[0], 1, "descriptors"), [[1], [0]])
    np.testing.assert_allclose(similarity_at(references, references[0], np.zeros(2), "descriptors"), [1, 0], atol=1e-6)
