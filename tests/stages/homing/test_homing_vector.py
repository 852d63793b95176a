"""The vector of a local map whose answer is seen by eye."""

import math
from dataclasses import replace

import numpy as np
import pytest

from omninav.pipeline import Context
from omninav.stages.geometry.two_views.epipolar import turn_about_vertical
from omninav.stages.homing.homing_vector import HomingVectorFromMap
from omninav.stages.values.homing import HomingVector, LocalMap


def vector(map: LocalMap) -> HomingVector:
    found = HomingVectorFromMap().step(Context("homing"), map).vector
    assert found is not None
    return found


def test_a_vector_is_in_the_robots_frame_and_its_lengths_are_in_their_units() -> None:
    # The robot at (1, 0) has turned by 90 degrees to the left, the target at (-3, 3) by 120: it is 3 ahead and 4 left.
    here, turned = np.array([1.0, 0.0, 0.0]), [turn_about_vertical(math.radians(angle)) for angle in (90.0, 120.0)]
    map = LocalMap(
        7, 3, "tracking", 20, rows=np.arange(3), places=here + 10.0 * np.eye(3), rotation=turned[0], translation=here,
        goal_rotation=turned[1], goal_translation=np.array([-3.0, 3.0, 0.0]), unit=0.04, metres=0.3,
    )  # fmt: skip
    found = vector(map)
    assert (found.number, found.inliers, found.state) == (3, 20, "tracking")
    assert (found.direction, found.turn) == pytest.approx((math.atan2(4.0, 3.0), math.radians(30.0)))
    assert (found.distance, found.ratio, found.nearness, found.metres) == pytest.approx((5.0, 0.2, 0.5, 1.5))
    at_robot = replace(map, places=np.tile(here, (3, 1)), metres=0.0)
    assert (vector(at_robot).nearness, vector(at_robot).metres) == (1.0, None)
    none = vector(LocalMap(-1, 3, "lost"))
    assert (none.direction, none.turn, none.distance, none.ratio, none.nearness) == (0.0, 0.0, 1.0, 1.0, 1.0)
