"""Motions in the plane against those composed of them."""

import numpy as np
import pytest

from omninav.stages.geometry.plane.se2 import chain, compose, power


def test_a_part_of_a_motion_made_several_times_is_the_motion() -> None:
    motions = np.array([[0.4, -0.1, 1.2], [0.4, 0.1, -3.0], [0.4, 0.1, 0.0], [0.0, 0.0, 2.0]])
    thirds = power(motions, 1.0 / 3.0)
    assert compose(compose(thirds, thirds), thirds) == pytest.approx(motions)
    assert power(motions[0], 3.0) == pytest.approx(chain(np.tile(motions[0], (3, 1)))[-1])
    assert compose(motions, power(motions, -1.0)) == pytest.approx(np.zeros((4, 3)))
