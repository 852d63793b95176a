from dataclasses import replace

import numpy as np

from omninav.pipeline.graph.contents import violation
from omninav.stages.geometry.two_views.epipolar import turn_about_vertical
from omninav.stages.values.homing import LocalMap
from omninav.stages.values.pose import Motion


def test_a_motion_moves_the_robot_in_its_own_frame_by_the_metres_of_a_unit() -> None:
    west, at, goal = turn_about_vertical(np.pi / 2), np.array([1.0, 2.0, 0.0]), np.array([-2.0, 6.0, 3.0])
    map = LocalMap(1, 1, "tracking", rotation=west, translation=at, goal_translation=goal, metres=2.0)
    np.testing.assert_allclose([*map.to_target(), map.distance()], [4.0, 3.0, 3.0, 5.0], atol=1e-12)
    assert replace(map, places=np.array([[1, 2, 3], [1, 2, 9], [4, 6, 0]])).depth() == 5.0  # of 3, 9 and 5
    moved = map.moved(Motion(2.0, 4.0, np.pi / 2))  # a unit ahead, which is +y, and two to the left, which is -x
    np.testing.assert_allclose(moved.translation, [-1.0, 3.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(moved.rotation, np.diag([-1.0, -1.0, 1.0]), atol=1e-12)
    np.testing.assert_allclose(moved.odometry, [2.0, 4.0, np.pi / 2], atol=1e-12)
    assert replace(map, metres=0.0).moved(Motion(2.0, 4.0, 0.0)).translation.tolist() == [1.0, 2.0, 0.0]
    assert map.moved(None) is map
    assert violation(LocalMap(1, 1, "lost")) is None
