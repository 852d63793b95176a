import math

import numpy as np
import pytest

from omninav.stages.geometry.plane.mount import camera_poses, found_mount, robot_covariances, robot_poses
from omninav.stages.geometry.plane.se2 import chain, wrap

MOUNT = np.array([0.3, -0.1, 0.2])


def driven(steps: int = 200, turns: float = 0.3, seed: int = 0) -> np.ndarray:
    """Poses of a robot that drives and turns by random amounts."""
    rng = np.random.default_rng(seed)
    return chain(np.column_stack([rng.uniform(0.2, 0.6, steps), np.zeros(steps), turns * rng.normal(size=steps)]))


def test_a_camera_in_front_and_to_the_left_of_a_robot_that_looks_along_y() -> None:
    camera = camera_poses(np.array([[1.0, 2.0, math.pi / 2]]), np.array([0.3, 0.1, math.pi / 4]))
    assert camera == pytest.approx(np.array([[0.9, 2.3, 3 * math.pi / 4]]))


def test_the_robot_is_where_it_was_before_its_camera_was_asked() -> None:
    robot = driven()
    back = robot_poses(camera_poses(robot, MOUNT), MOUNT)
    assert back[:, :2] == pytest.approx(robot[:, :2])
    assert wrap(back[:, 2] - robot[:, 2]) == pytest.approx(np.zeros(len(robot)), abs=1e-12)
    assert robot_poses(robot, np.zeros(3)) is robot
    assert camera_poses(robot, np.zeros(3)) is robot


def test_a_covariance_is_that_of_robots_under_cameras_drawn_from_it() -> None:
    rng, camera = np.random.default_rng(0), np.array([[4.0, -2.0, 0.7], [0.0, 1.0, -2.0]])
    covariances = np.stack([np.diag([0.01, 0.02, 0.05]) ** 2, np.diag([0.02, 0.01, 0.1]) ** 2])
    given = robot_covariances(covariances, camera, MOUNT)
    for n in range(2):
        drawn = robot_poses(rng.multivariate_normal(camera[n], covariances[n], 200_000), MOUNT)
        assert given[n] == pytest.approx(np.cov(drawn.T), rel=0.1, abs=3e-5)
    assert robot_covariances(covariances, camera, np.zeros(3)) is covariances


@pytest.mark.parametrize("mount", [MOUNT, np.array([-1.2, 0.0, 0.0]), np.array([0.0, 0.0, -0.14])])
def test_a_mount_is_found_in_noise_among_wrong_steps_whatever_the_scale(mount) -> None:
    robot, rng = driven(), np.random.default_rng(1)
    camera = camera_poses(robot, mount)
    camera[:, :2] = 1.1 * camera[:, :2] + rng.normal(0.0, 0.002, (len(robot), 2))
    robot[50:, :2] += 1.0  # odometry slips
    robot[120:] += [0.0, 3.0, 0.0]
    found = found_mount(camera, robot)
    assert found[:2] == pytest.approx(1.1 * mount[:2], abs=0.004)
    assert found[2] == pytest.approx(mount[2], abs=0.002)


def test_of_a_camera_on_the_robots_axis_none_is_found() -> None:
    robot, rng = driven(), np.random.default_rng(2)
    assert found_mount(robot + rng.normal(0.0, 0.01, robot.shape) * [1.0, 1.0, 0.1], robot) is None
    near = camera_poses(robot, np.array([0.01, 0.0, 0.01]))
    assert found_mount(near, robot) is None
    assert found_mount(near, robot, left=True) == pytest.approx([0.01, 0.0, 0.01], abs=1e-4)


def test_a_drive_straight_ahead_or_of_few_steps_or_on_one_spot_tells_none() -> None:
    standing = np.column_stack([np.ones((60, 2)), np.arange(60.0)])
    for robot in (driven(turns=0.01), driven(steps=15), standing, np.ones((60, 3))):
        assert found_mount(camera_poses(robot, MOUNT), robot) is None


def test_a_mount_that_noise_could_be_is_none() -> None:
    robot, rng = driven(turns=0.12), np.random.default_rng(3)
    camera = camera_poses(robot, np.array([0.05, 0.0, 0.0]))
    camera[:, :2] += rng.normal(0.0, 0.03, (len(robot), 2))
    assert found_mount(camera, robot) is None
