"""The belief over places, against sums done by hand."""

import numpy as np
import pytest

from omninav.stages.geometry.appearance.place_graph import links_between
from omninav.stages.values.belief import PlaceBelief

CHAIN = np.array([[0, 1], [1, 2], [2, 3]])


def test_links_are_counted_along_the_shortest_way_in_either_direction():
    apart = links_between(np.vstack([CHAIN, [[3, 0]]]), 5)
    assert apart[:4, :4].tolist() == [[0, 1, 2, 1], [1, 0, 1, 2], [2, 1, 0, 1], [1, 2, 1, 0]]
    assert np.isinf(apart[4, :4]).all()
    assert apart[4, 4] == 0


def test_the_estimate_is_the_most_probable_place_turned_as_the_view_is():
    poses = np.array([[0.0, 0.0, 0.0], [4.0, 2.0, 1.0]])
    estimate = PlaceBelief(np.array([0.3, 0.7]), poses).estimate()
    assert (estimate.pose.x, estimate.pose.y, estimate.pose.heading) == (4.0, 2.0, 1.0)
    assert estimate.mode_weight == pytest.approx(0.7)
    assert estimate.mean.x == pytest.approx(2.8)
