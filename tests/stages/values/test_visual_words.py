import numpy as np
import pytest

from omninav.stages.values.visual_words import WordSimilarities


def similar(*values: float) -> WordSimilarities:
    return WordSimilarities(np.array(values, np.float32))


def test_factors_are_a_power_of_the_similarity() -> None:
    assert similar(0.81, 0.16).factors(2, None, 0.5) == pytest.approx([0.9, 0.4])
    assert similar(0.81, 0.16, 0.25).factors(3, np.array([2, 0]), 0.5) == pytest.approx([0.5, 0.9])


def test_a_reference_without_common_words_is_not_ruled_out() -> None:
    assert similar(0.5, 0.0).factors(2, None, 1.0)[1] == pytest.approx(0.01)


def test_a_view_without_words_and_references_learned_since_are_not_judged() -> None:
    assert similar(0.0, 0.0).factors(2, None, 0.5).tolist() == [1.0, 1.0]
    assert similar(0.36, 0.25).factors(3, None, 0.5) == pytest.approx([0.6, 0.5, 0.6])
