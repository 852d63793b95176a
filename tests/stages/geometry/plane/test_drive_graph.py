"""Drives placed beside each other, worked by hand."""

import math

import numpy as np
import pytest

from omninav.stages.geometry.plane.drive_graph import Closures, closure_sigmas, odometry_sigmas, placed_drives
from omninav.stages.geometry.plane.se2 import between, compose

OWN = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.5, 1.0], [3.0, 2.0, 1.5]])


def test_sigmas_by_hand_of_five_metres_and_a_turn_of_two():
    assert odometry_sigmas(np.array([[3.0, 4.0, -2.0]])) == pytest.approx(np.array([[0.105, 0.105, 0.2025]]))
    assert closure_sigmas(2.0) == pytest.approx((1.0, math.radians(5.0)))


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize(("right", "joined"), [(3, True), (2, False)])
def test_three_closures_that_agree_join_a_drive(right: int, joined: bool, turned: bool):
    # The second drive saw the same places turned by 0.4, in a frame of its own; its other closures are 90 degrees off.
    elsewhere = np.array([-4.0, 7.0, 2.0])
    own = np.concatenate([OWN, between(elsewhere, OWN + np.array([0.0, 0.0, 0.4]))])
    pairs, turns = np.arange(4)[:, None] + [0, 4], 0.4 + np.where(np.arange(4) < right, 0.0, math.pi / 2)
    closures = Closures(pairs[:, ::-1], -turns) if turned else Closures(pairs, turns)
    poses, found = placed_drives(own, np.repeat([0, 1], 4), closures, 0.5)
    assert found.tolist() == [True, joined]
    assert poses[4:] == pytest.approx(compose(elsewhere, own[4:]) if joined else own[4:])
