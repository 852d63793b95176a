"""Neighbours of a view in a map, by hand-worked distances."""

import math

import numpy as np
import pytest
from made_view_maps import learned, view

from omninav.pipeline import Context
from omninav.pipeline.graph.problems import BadInput
from omninav.stages.geometry.appearance.view_similarity import similarity
from omninav.stages.match.neighbours import ViewNeighbours
from omninav.stages.values.view_mixtures import ViewMixtures
from omninav.stages.values.views import Neighbours, NoveltyThreshold


def map_of(*looks: float) -> ViewMixtures:
    kept = ViewMixtures.empty()
    for look in looks:
        learned(look, map=kept)
    return kept


def near(stage: ViewNeighbours, kept: ViewMixtures, limit: float | None) -> Neighbours:
    given = None if limit is None else NoveltyThreshold(limit)
    return stage.step(Context("match"), view(0.0, 0.0), kept, given).neighbours


def test_all_within_the_limit_come_nearest_first_with_a_similarity_that_ends_there() -> None:
    found = near(ViewNeighbours(), map_of(3.0, 9.0, 1.0, 4.0), 4.0)
    assert found.rows.tolist() == [2, 0]
    assert found.distances.tolist() == [1.0, 3.0]
    assert found.similarities.tolist() == [0.75, 0.25]
    assert found.turns.tolist() == [0.0, 0.0]
    assert found.nearest == 1.0


def test_without_a_limit_or_a_view_there_are_none() -> None:
    assert near(ViewNeighbours(), map_of(3.0), None).rows.tolist() == []
    assert near(ViewNeighbours(), map_of(3.0), None).nearest == 3.0
    assert near(ViewNeighbours(), map_of(), 4.0).nearest == math.inf


def test_a_count_takes_the_nearest_however_far_and_ends_the_similarity_at_the_next() -> None:
    found = near(ViewNeighbours(count=2), map_of(6.0, 8.0, 4.0, 2.0), None)
    assert found.rows.tolist() == [3, 2]
    assert found.similarities == pytest.approx([2 / 3, 1 / 3])
    assert near(ViewNeighbours(count=9), map_of(6.0, 3.0), None).similarities == pytest.approx([0.5, 0.0])
    assert near(ViewNeighbours(count=9), map_of(6.0), None).similarities == pytest.approx([1.0])


def test_similarity_falls_from_one_to_zero_at_the_limit() -> None:
    assert similarity(np.array([0.0, 1.0, 2.0, 3.0]), 2.0) == pytest.approx([1.0, 0.5, 0.0, 0.0])
    assert (np.diff(similarity(np.linspace(0, 3, 50), 2.0)) <= 0.0).all()


def test_a_map_of_other_views_is_refused_with_both_named() -> None:
    with pytest.raises(BadInput, match=r"Coefficients of 2 numbers, the current one is Coefficients of 3"):
        ViewNeighbours().step(Context("match"), view(1.0, 2.0, 3.0), map_of(1.0), None)
