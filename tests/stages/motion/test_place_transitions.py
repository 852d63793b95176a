"""How a belief spreads over the links of a topological map."""

import math

import numpy as np
import pytest

from omninav.stages.motion.place_transitions import transitions


def test_neighbours_share_by_the_gaussian_of_their_links_and_any_place_may_be_reached():
    near = math.exp(-((1.0 / 2.0) ** 2))
    stays, goes = 0.9 / (1.0 + near) + 0.05, 0.9 * near / (1.0 + near) + 0.05
    found = transitions(np.array([[0.0, 1.0], [1.0, 0.0]]), 2.0, teleport_probability=0.1)
    assert found == pytest.approx(np.array([[stays, goes], [goes, stays]]))


def test_without_a_sigma_it_is_the_spread_of_the_known_links():
    links = np.array([[0.0, 2.0, np.inf], [2.0, 0.0, 4.0], [np.inf, 4.0, 0.0]])
    sigma = float(np.std([0.0, 2.0, 2.0, 0.0, 4.0, 4.0, 0.0]))
    found = transitions(links, None, teleport_probability=0.0)
    assert found == pytest.approx(transitions(links, sigma, teleport_probability=0.0))
    assert found[0, 2] == 0.0
    assert found.sum(axis=1) == pytest.approx(1.0)


def test_places_without_links_keep_their_belief():
    apart = np.array([[0.0, np.inf], [np.inf, 0.0]])
    assert transitions(apart, None, teleport_probability=0.0).tolist() == [[1.0, 0.0], [0.0, 1.0]]
