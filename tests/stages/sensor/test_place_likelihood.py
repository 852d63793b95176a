"""Likelihoods of places, against sums done by hand."""

import math
from dataclasses import replace

import numpy as np
import pytest
from made_places import made_map

from omninav.pipeline import Context
from omninav.stages.sensor.place_likelihood import PlaceLikelihood, place_likelihoods, word_likelihoods
from omninav.stages.values.visual_distance import VisualDistances
from omninav.stages.values.visual_words import WordSimilarities


def test_likelihood_is_a_gaussian_of_visual_distance_that_never_falls_to_nothing():
    values = place_likelihoods(np.array([0.0, 0.5, math.inf]), 0.5, 0.01, "gaussian")
    assert values == pytest.approx([1.0, 0.01 + 0.99 * math.exp(-1), 0.01])


def test_with_a_heavy_tail_the_least_unlike_of_unlike_places_is_still_the_likeliest():
    far = np.array([10.0, 20.0, math.inf])  # in units of sigma
    assert place_likelihoods(far, 1.0, 0.001, "gaussian") == pytest.approx([0.001] * 3)
    heavy = place_likelihoods(far, 1.0, 0.001, "heavy")
    assert heavy == pytest.approx([0.001 + 0.999 / 101, 0.001 + 0.999 / 401, 0.001])


def test_words_tell_places_apart_by_how_much_less_similar_they_are_than_the_best():
    found = word_likelihoods(np.array([0.4, 0.5, 0.0], np.float32), 20.0, 0.001)
    assert found == pytest.approx([0.001 + 0.999 * math.exp(-2), 1.0, 0.001 + 0.999 * math.exp(-10)], rel=1e-5)
    assert word_likelihoods(np.zeros(3, np.float32), 20.0, 0.001) == pytest.approx([1.0] * 3)  # an image without words


def test_visual_distance_counts_in_spreads_of_the_map_and_words_are_a_factor_beside_it():
    map = replace(made_map([(0.0, 0.0), (1.0, 0.0)], {}), spread=0.5)
    seen = VisualDistances(np.array([0.0, 1.0]), np.zeros(2), np.ones(2, np.int64))
    words, ctx = WordSimilarities(np.array([0.4, 0.5], np.float32)), Context("sensor")
    alone = PlaceLikelihood().step(ctx, seen, map).likelihood.values
    assert alone == pytest.approx([1.0, 0.001 + 0.999 / 5])
    assert PlaceLikelihood(sigma=1.0).step(ctx, seen, map).likelihood.values[1] == pytest.approx(0.001 + 0.999 / 2)
    both = PlaceLikelihood().step(ctx, seen, map, words).likelihood.values
    assert both == pytest.approx(alone * [0.001 + 0.999 * math.exp(-2), 1.0], rel=1e-5)
