"""The vertical of a camera that leans, found in two of its images."""

import math

import numpy as np
import pytest

from omninav.stages.geometry.two_views.epipolar import turn_about_vertical
from omninav.stages.geometry.two_views.ransac import AgreedPose
from omninav.stages.homing.vertical import levelling, seen_leaning, vertical_of

UP = np.array([math.sin(math.radians(3.0)), -math.sin(math.radians(1.0)), 0.0])
UP[2] = math.sqrt(1.0 - UP @ UP)
LEVEL = levelling(UP)
THRESHOLD = math.radians(1.0)


def views(turn, level=LEVEL, wrong=20, seed=1):
    """Bearings of 60 points from two places of a robot on a floor, in the frame of its camera; some paired wrongly."""
    rng = np.random.default_rng(seed)
    points = rng.uniform([-4.0, -4.0, -1.0], [4.0, 4.0, 2.0], (60, 3))
    there = (points - [1.2, 0.5, 0.0]) @ turn_about_vertical(turn)
    first, second = (each / np.linalg.norm(each, axis=1)[:, None] @ level for each in (points, there))
    second[:wrong] = rng.permutation(second[:wrong])
    return first, second


def off(vertical, up):
    return math.degrees(math.acos(min(1.0, float(vertical @ up))))


@pytest.mark.parametrize("turn", [0.4, 2.0, -1.0, math.pi - 0.3])
def test_it_is_the_axis_about_which_the_robot_turned(turn):
    found = vertical_of(*views(turn), np.random.default_rng(0), THRESHOLD, 30)
    assert off(found, UP) < 0.1


def test_that_of_an_upright_camera_is_up():
    found = vertical_of(*views(1.0, np.eye(3)), np.random.default_rng(0), THRESHOLD, 30)
    assert off(found, np.array([0.0, 0.0, 1.0])) < 0.1


@pytest.mark.parametrize(
    ("given", "min_inliers"),
    [
        (views(0.1), 30),  # a turn too small to tell its axis
        (views(1.0), 50),  # more than agree
        (views(1.0), 61),  # more than there are
        (views(1.0, levelling(np.array([0.6, 0.0, 0.8]))), 30),  # no camera leans by 37 degrees
    ],
)
def test_it_is_not_told_where_little_shows_it(given, min_inliers):
    assert vertical_of(*given, np.random.default_rng(0), THRESHOLD, min_inliers) is None


def test_levelling_brings_the_vertical_up_and_turns_nothing():
    np.testing.assert_allclose(LEVEL @ UP, [0.0, 0.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(LEVEL @ LEVEL.T, np.eye(3), atol=1e-12)
    assert LEVEL[0, 1] == pytest.approx(LEVEL[1, 0])
    assert np.array_equal(levelling(np.array([0.0, 0.0, 1.0])), np.eye(3))


def test_a_pose_between_level_frames_is_one_between_the_cameras():
    level = AgreedPose(turn_about_vertical(1.0), np.array([0.6, 0.8, 0.0]), np.ones(1, np.bool_), 1)
    pose = seen_leaning(level, LEVEL)
    point = np.array([1.0, -2.0, 0.5])  # in the second camera's frame
    there = level.rotation @ (LEVEL @ point) + level.translation
    np.testing.assert_allclose(LEVEL @ (pose.rotation @ point + pose.translation), there, atol=1e-12)
