import numpy as np
import pytest

from omninav.stages.values.visual_words import PlaceWords, WordSimilarities, words_of


def similar(*values: float) -> WordSimilarities:
    return WordSimilarities(np.array(values, np.float32))


def test_factors_are_a_power_of_the_similarity() -> None:
    assert similar(0.81, 0.16).factors(2, None, 0.5) == pytest.approx([0.9, 0.4])
    assert similar(0.81, 0.16, 0.25).factors(3, np.array([2, 0]), 0.5) == pytest.approx([0.5, 0.9])


def test_views_are_as_similar_as_the_cosine_between_their_weighted_words() -> None:
    words = np.eye(4, dtype=np.uint8)
    views = [words[[0, 0, 0, 0, 1]], words[[1, 2]], words[[3]], words[[2]]]  # rarity log 5, 3, 3 and 5
    known = words_of(views, np.eye(4, dtype=np.float32))
    whole = np.array([[2 * np.log(5), np.log(3), 0, 0], [0, 1, 1, 0], [0, 0, 0, 1], [0, 0, 1, 0]])
    whole /= np.linalg.norm(whole, axis=1, keepdims=True)
    seen = np.array([0.0, np.log(3), np.sqrt(2) * np.log(3), 0.0])
    expected = whole @ seen / np.linalg.norm(seen)
    assert known.similarities(words[[2, 1, 2]]) == pytest.approx(expected, abs=1e-6)
    assert known.of_views(np.array([3, 0])).similarities(words[[2, 1, 2]]) == pytest.approx(expected[[3, 0]], abs=1e-6)
    assert known.similarities(words[:0]).tolist() == [0.0] * 4
    assert len(known) == 4
    assert len(PlaceWords(known, np.array([0, 2, 1, 0]), np.zeros((4, 3)), "truth")) == 3


def test_a_reference_without_common_words_is_not_ruled_out() -> None:
    assert similar(0.5, 0.0).factors(2, None, 1.0)[1] == pytest.approx(0.01)


def test_a_view_without_words_and_references_learned_since_are_not_judged() -> None:
    assert similar(0.0, 0.0).factors(2, None, 0.5).tolist() == [1.0, 1.0]
    assert similar(0.36, 0.25).factors(3, None, 0.5) == pytest.approx([0.6, 0.5, 0.6])
