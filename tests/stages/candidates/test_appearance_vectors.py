"""Views as short vectors, against numbers worked by hand."""

import numpy as np
import pytest

from omninav.stages.candidates.appearance_vectors import appearance_vectors, principal_axes
from omninav.stages.candidates.exact_search import ExactSearch
from omninav.stages.values.reference_index import ShortVectors


def test_vectors_of_whole_views_have_length_one_and_histograms_the_distance_of_hellinger() -> None:
    counts = appearance_vectors(np.array([[[1.0, 0.0], [0.36, 0.64]]]), "histograms")
    assert counts == pytest.approx(np.array([[1.0, 0.0, 0.6, 0.8]]) / np.sqrt(2.0))
    white = appearance_vectors(np.full((1, 4, 3), 255.0), "colours")
    assert white == pytest.approx(np.full((1, 12), 1.0 / np.sqrt(12.0)))
    assert appearance_vectors(np.full((1, 4, 1), -1.0), "descriptors") == pytest.approx(np.full((1, 4), -0.5))


def test_the_first_axis_is_that_along_which_vectors_vary_most_and_their_number_is_even() -> None:
    along, across = np.array([0.6, 0.8, 0.0]), np.array([-0.8, 0.6, 0.0])
    vectors = np.array([-2.0 * along, 2.0 * along, across, -across]) + np.array([5.0, 6.0, 7.0])
    mean, axes = principal_axes(vectors.astype(np.float32), 1)
    assert mean == pytest.approx([5.0, 6.0, 7.0])
    assert np.abs(axes.T) == pytest.approx(np.array([[0.6, 0.8, 0.0], [0.0, 0.0, 0.0]]), abs=1e-6)
    assert np.abs(principal_axes(vectors.astype(np.float32), 2)[1][:, 1]) == pytest.approx([0.8, 0.6, 0.0], abs=1e-6)


def test_what_short_vectors_leave_out_of_a_query_tells_which_turn_is_like_the_map() -> None:
    index = ShortVectors(np.array([1.0, 0.0, 0.0]), np.eye(3)[:, :2], np.array([[3.0, 0.0], [0.0, 0.0], [9.0, 9.0]]))
    turns = np.array([[4.0, 0.0, 9.0], [2.0, 0.0, 0.0]])  # squares to the three: 81, 90, 117 + 81; and 4, 1, 64 + 81
    search = ExactSearch(index)
    assert [search.nearest(turns, number).tolist() for number in (1, 2, 3)] == [[1], [0, 1], [0, 1, 2]]
    assert search.nearest(turns[:1], 1).tolist() == [0]
