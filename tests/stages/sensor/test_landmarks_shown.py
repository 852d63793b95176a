"""A pose is doubted as far as the landmarks are missing that references near it see."""

import math

import numpy as np
import pytest

from omninav.stages.sensor.landmarks_shown import LandmarksShown, landmarks_to_expect
from omninav.stages.values.landmarks import Landmarks
from omninav.stages.values.visual_words import words_of


def landmarks(*seen: int) -> Landmarks:
    """A number of landmarks for each reference that was there when they were learned."""
    starts = np.concatenate(([0], np.cumsum(seen)))
    points = max(seen)
    return Landmarks(
        np.zeros((points, 3), np.float32), np.zeros((points, 128), np.uint8), starts,
        np.concatenate([np.arange(number, dtype=np.int32) for number in seen]), 0.001,
        words_of([np.full((1, 128), 1, np.uint8)] * len(seen), np.ones((1, 128), np.float32)), 1.0,
    )  # fmt: skip


def test_one_expects_what_the_nearest_reference_sees_and_less_the_farther_it_is() -> None:
    references = np.array([[0.0, 0.0, 0.0], [4.0, 0.0, 1.0], [40.0, 0.0, 0.0]])  # the last was learned since
    poses = np.array([[0.0, 0.0, 2.0], [0.0, 0.8, 0.0], [4.0, 0.0, 0.0], [4.0, 3.2, 0.0], [40.0, 0.0, 0.0]])
    expected = landmarks_to_expect(landmarks(200, 100), references, poses, 0.5)
    assert expected == pytest.approx([90.0, 45.0, 45.0, 45.0 / 256.0, 0.0], abs=1e-9)


def test_missing_landmarks_speak_against_a_pose_and_as_many_as_are_expected_for_none() -> None:
    told = LandmarksShown(0.0).log_odds(
        np.array([90, 120, 33, 9, 1, 8, 1]), np.array([90.0, 90.0, 90.0, 90.0, 90.0, 0.0, 0.5])
    )
    assert told == pytest.approx([0.0, 0.0, -0.5 * math.log(90 / 33) ** 2, -0.5 * math.log(10) ** 2, -4.0, 0.0, 0.0])


def test_a_drive_in_the_dark_teaches_to_expect_fewer() -> None:
    expected, shown = np.full(1, 90.0), LandmarksShown()
    assert shown.log_odds(np.array([36]), expected) == pytest.approx(0.0)  # at first two fifths do
    for _ in range(100):
        shown = shown.seen(np.array([9]), expected, 0.9)
    assert math.exp(shown.log_share) == pytest.approx(0.1, rel=0.05)
    assert shown.seen(np.array([90]), expected, 0.0).log_share == shown.log_share  # a wrong pose teaches nothing
    for _ in range(200):
        shown = shown.seen(np.array([400]), expected, 1.0)
    assert shown.log_share == pytest.approx(0.0, abs=1e-3)  # more than all are as good as all
