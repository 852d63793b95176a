import numpy as np
import pytest
from small_run import mixture_run, small_run

from omninav.pipeline import Context
from omninav.stages.metrics.best_reference import BestReference
from omninav.stages.values.similarity import Similarities
from omninav.stages.values.views import Neighbours
from omninav.stages.values.visual_distance import VisualDistances


def best(match, map=None):
    return BestReference().step(Context("best"), match, map).best_match


def test_the_most_similar_reference_is_named_as_the_map_numbers_it():
    values = np.array([[0.1, 0.2, 0.3, 0.4], [0.0, 0.0, 0.0, 0.75]], np.float32)
    found = best(Similarities(values, candidates=np.array([4, 9])))
    assert (found.reference, found.similarity, found.distance) == (9, 0.75, None)
    assert found.turn == pytest.approx(-np.pi / 2)


def test_the_nearest_view_keeps_its_number_when_others_are_forgotten():
    map = mixture_run(small_run(frames=10))[0]
    row = np.array([len(map) - 1])
    neighbours = Neighbours(row, np.array([0.2]), np.array([0.6]), np.array([0.1]), 0.2)
    found = best(neighbours, map)
    assert (found.reference, found.similarity, found.distance) == (9, 0.6, 0.2)
    assert best(neighbours).reference == row[0] < 9


def test_of_several_views_the_first_is_the_nearest():
    found = best(Neighbours(np.array([3, 1]), np.array([0.2, 0.5]), np.array([0.6, 0.3]), np.array([0.1, 0.9]), 0.2))
    assert (found.reference, found.distance, found.similarity, found.turn) == (3, 0.2, 0.6, 0.1)


def test_the_nearest_place_has_a_distance_and_no_similarity():
    found = best(VisualDistances(np.array([np.inf, 3.0, 2.0]), np.array([0.0, 0.1, 0.2]), np.array([0, 9, 9])))
    assert (found.reference, found.distance, found.turn, found.similarity) == (2, 2.0, 0.2, None)


@pytest.mark.parametrize(
    "match",
    [
        Similarities(np.zeros((0, 4), np.float32)),
        Neighbours(np.zeros(0, np.int64), np.zeros(0), np.zeros(0), np.zeros(0), np.inf),
        VisualDistances(np.array([np.inf]), np.zeros(1), np.zeros(1, np.int64)),
    ],
    ids=lambda match: type(match).__name__,
)
def test_an_image_that_resembles_nothing_has_no_best_match(match):
    assert best(match) is None
