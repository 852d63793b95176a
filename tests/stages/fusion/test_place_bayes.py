"""Bayes' rule over places."""

from dataclasses import replace

import numpy as np
import pytest
from made_places import made_map

from omninav.pipeline import Context
from omninav.stages.fusion.place_bayes import PlaceBayes
from omninav.stages.values.belief import Likelihood, PlaceBelief
from omninav.stages.values.visual_distance import VisualDistances

MAP = made_map([(0.0, 0.0), (1.0, 0.0), (2.0, 0.0)], {})


def fused(predicted: list[float], likelihood: list[float], ctx: Context | None = None) -> PlaceBelief:
    distances = VisualDistances(np.ones(3), np.zeros(3), np.ones(3, np.int64))
    prediction = PlaceBelief(np.array(predicted), MAP.poses[MAP.places])
    stage, seen = PlaceBayes(), Likelihood(np.array(likelihood))
    return stage.step(ctx or Context("fusion"), prediction, seen, distances, MAP).belief


def test_prediction_times_likelihood_is_normalised():
    found = fused([0.5, 0.3, 0.2], [1.0, 2.0, 8.0])
    np.testing.assert_allclose(found.probabilities, np.array([0.5, 0.6, 1.6]) / 2.7)
    assert found.estimate().pose.x == 2.0


def test_a_view_that_no_place_explains_leaves_the_prediction_and_is_counted():
    ctx = Context("fusion")
    np.testing.assert_allclose(fused([0.5, 0.3, 0.2], [0.0, 0.0, 0.0], ctx=ctx).probabilities, [0.5, 0.3, 0.2])
    assert ctx.counts["belief_without_support"] == 1


def test_headings_are_those_of_the_medoids_turned_as_the_view_is():
    map = replace(made_map([(5.0, 6.0), (7.0, 8.0)], {}), poses=np.array([[5.0, 6.0, 0.25], [7.0, 8.0, -1.0]]))
    distances = VisualDistances(np.ones(2), np.array([0.5, -2.75]), np.ones(2, np.int64))
    prediction = PlaceBelief(np.array([0.5, 0.5]), map.poses)
    out = PlaceBayes().step(Context("fusion"), prediction, Likelihood(np.array([0.2, 0.6])), distances, map).belief
    assert out.poses == pytest.approx(np.array([[5.0, 6.0, 0.75], [7.0, 8.0, 2 * np.pi - 3.75]]))
    assert out.probabilities == pytest.approx([0.25, 0.75])
