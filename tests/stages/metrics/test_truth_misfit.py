"""A truth in another frame, unit or clock is told from an estimate that is wrong."""

import math
import re

import numpy as np
import pytest
from measured_drives import made_drive

from omninav.pipeline import Context
from omninav.stages.geometry.plane.se2 import compose
from omninav.stages.metrics.trajectory_errors import TrajectoryErrors
from omninav.stages.metrics.truth_misfit import truth_misfit
from omninav.stages.values.confidence import PoseConfidence

ANGLES = np.linspace(0.0, 2.0 * math.pi, 80, endpoint=False)
X, Y = 6.0 * np.cos(ANGLES), 4.0 * np.sin(ANGLES) * (1.2 + np.cos(ANGLES))
PATH = np.column_stack([X, Y, np.arctan2(np.gradient(Y), np.gradient(X))])
"""Poses around a bent loop, one a second."""
SURE = [PoseConfidence(0.6, "tracking")] * len(PATH)


@pytest.mark.parametrize(
    ("truth", "said"),
    [
        (PATH * (1, -1, -1), "mirrored: check the signs of y and heading"),
        (PATH * (100, 100, 1), r"multiplied by 0\.01: check its unit"),
        (PATH + np.array([0, 0, 1.0]), r"turned by -57 degrees"),
        (PATH + np.array([0, 0, math.radians(30.5)]), r"turned by -30 degrees"),
        (PATH + np.array([0, 0, math.radians(29.5)]), ""),
        (PATH * (1, 1, -1), "turned the other way"),
        (PATH * (1, 1, 0) + np.random.default_rng(0).uniform(0.0, 6.0, (80, 1)) * (0, 0, 1), ""),
        (PATH * (1.4, 1.4, 1), r"multiplied by 0\.714: check its unit"),
        (PATH @ np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1]]), r"turned in place by \+90 degrees"),
        (compose(np.array([5.0, 3.0, 2.0]), PATH), r"moved by 12\.07 m, as in another frame"),
        (np.roll(PATH, 3, axis=0), r"3 s earlier: check that both are stamped by one clock"),
        (np.roll(PATH, 1, axis=0), r"1 s earlier"),
        (np.roll(PATH, -2, axis=0), r"2 s later"),
        (np.roll(PATH, -10, axis=0), r"10 s later"),
        (np.roll(PATH, 10, axis=0), r"10 s earlier"),
        (PATH + np.array([0.1, 0.0, 0.3]), ""),
        (PATH + np.random.default_rng(0).normal(0.0, 3.0, PATH.shape), "under no shift in time, turn"),
        (compose(PATH, np.array([0.5, -0.2, 0.0])), r"-0\.50 m forward and \+0\.20 m to the left on the robot"),
    ],
)
def test_the_change_with_which_a_truth_fits_is_named(truth: np.ndarray, said: str) -> None:
    ctx = Context("errors")
    TrajectoryErrors().step(ctx, made_drive(truth, PATH, confidences=SURE))
    assert len(ctx.warnings) == bool(said)
    assert re.search(said, "".join(ctx.warnings))


@pytest.mark.parametrize("offset", [(0.3, -0.2, 0.0), (3.0, 0.0, 0.0), (0.0, 0.0, 1.0)])
def test_of_a_robot_that_stands_still_no_change_of_the_truth_is_told(offset: tuple[float, float, float]) -> None:
    still = np.tile(PATH[:1], (80, 1))
    assert not truth_misfit(made_drive(still, still + np.array(offset), confidences=SURE))
    straight = still + np.outer(np.arange(80), [0.1, 0.0, 0.0])
    assert "on the robot" not in truth_misfit(made_drive(straight, straight + np.array(offset), confidences=SURE))


def test_images_without_a_truth_are_left_out_and_half_seconds_are_told() -> None:
    late = [None, *np.roll(PATH, -1, axis=0)[1:]]
    assert "0.5 s later" in truth_misfit(made_drive(late, PATH, every_s=0.5, confidences=SURE))


def test_a_robot_that_is_not_sure_of_its_place_may_be_wrong_itself() -> None:
    moved = compose(np.array([5.0, 3.0, 2.0]), PATH)
    assert truth_misfit(made_drive(moved, PATH, confidences=SURE))
    assert not truth_misfit(made_drive(moved, PATH))
    assert not truth_misfit(made_drive(moved, PATH, confidences=[PoseConfidence(0.4, "lost")] * 80))
