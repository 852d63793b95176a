import math

import numpy as np
import pytest

from omninav.stages.geometry.plane.image_delay import RobotPath, found_delay
from omninav.stages.geometry.plane.mount import camera_poses
from omninav.stages.geometry.plane.se2 import wrap

SECONDS = np.arange(0.0, 120.0, 0.1)


def driven(seconds: np.ndarray) -> np.ndarray:
    """Poses of a robot that drives a curve and swings to both sides, at any times (s)."""
    heading = 0.05 * seconds + 0.8 * np.sin(0.5 * seconds)
    return np.column_stack([3.0 * np.cos(0.1 * seconds), 2.0 * np.sin(0.07 * seconds), wrap(heading)])


def path(every: int = 4) -> RobotPath:
    return RobotPath(driven(SECONDS[10:-20:every]), SECONDS[10:-20:every], driven(SECONDS), SECONDS)


@pytest.mark.parametrize("delay", [0.15, -0.1, 0.6])
def test_the_delay_of_a_camera_that_is_turned_and_sits_beside_is_found_in_noise(delay) -> None:
    rng, robot = np.random.default_rng(0), path()
    camera = camera_poses(driven(robot.stamps - delay), np.array([0.3, -0.1, 0.4]))
    camera[:, 2] += rng.normal(0.0, math.radians(0.2), len(camera))
    camera[30:, 2] += math.radians(40.0)  # odometry slips
    assert found_delay(camera, robot) == pytest.approx(delay, abs=0.01)
    assert robot.before(delay) == pytest.approx(driven(robot.stamps - delay), abs=0.001)


def test_images_in_time_a_robot_that_turns_evenly_and_few_images_tell_none() -> None:
    robot, rng = path(), np.random.default_rng(1)
    assert robot.before(0.0) is robot.poses
    noise = rng.normal(0.0, math.radians(0.5), len(robot.poses))
    assert found_delay(robot.poses + noise[:, None] * [0.0, 0.0, 1.0], robot) == 0.0
    few = RobotPath(robot.poses[:40], robot.stamps[:40], robot.driven, robot.times)
    assert found_delay(driven(few.stamps - 0.15), few) == 0.0
    even = np.column_stack([SECONDS, np.zeros(len(SECONDS)), wrap(0.3 * SECONDS)])
    turning = RobotPath(even[10:-10:4], SECONDS[10:-10:4], even, SECONDS)
    assert found_delay(even[8:-12:4], turning) == 0.0


def test_headings_that_are_noisy_tell_none_though_those_between_two_fit_better() -> None:
    found = []
    for seed in range(20):
        rng, exact, measured = np.random.default_rng(seed), driven(SECONDS), driven(SECONDS)
        measured[:, 2] = wrap(measured[:, 2] + rng.normal(0.0, math.radians(1.0), len(measured)))
        robot = RobotPath(measured[10:-20:4], SECONDS[10:-20:4], measured, SECONDS)
        found.append(found_delay(exact[10:-20:4], robot))
    assert not any(found)


def test_odometry_that_slips_in_its_few_turns_tells_none() -> None:
    found = []
    for seed in range(15):
        rng, turns = np.random.default_rng(seed), np.zeros(len(SECONDS))
        for begin in (400, 800):
            turns[begin : begin + 20] = math.pi / 2 / 20
        slipped = turns * (1.0 + 0.2 * rng.normal(size=len(turns)))
        exact, measured = (np.column_stack([SECONDS, SECONDS, wrap(np.cumsum(each))]) for each in (turns, slipped))
        robot = RobotPath(measured[10:-20:4], SECONDS[10:-20:4], measured, SECONDS)
        found.append(found_delay(exact[10:-20:4], robot))
    assert not any(found)
