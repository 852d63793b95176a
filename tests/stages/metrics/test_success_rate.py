"""Success as in Wolf, Burgard & Burkhardt 2005: all frames count, and a carried robot is found again."""

import math

import numpy as np
import pytest
from measured_drives import figures, made_drive, on_x, seen_at

from omninav.stages.metrics.success_rate import SuccessRate


def success(off: list[tuple[float, float]], modes: list[float] | None = None, carried: int | None = None):
    """The metric of a robot that drives 0.5 m a frame and is believed `off` (m aside, degrees) in each."""
    number = len(off)
    xs = [0.5 * n + (7.0 if carried is not None and n >= carried else 0.0) for n in range(number)]
    believed = [(x, aside, math.radians(degrees)) for x, (aside, degrees) in zip(xs, off, strict=True)]
    estimates = [seen_at(row, mode) for row, mode in zip(believed, modes or [1.0] * number, strict=True)]
    motion = [None, *[(0.5, 0.0, 0.0)] * (number - 1)]
    return figures(SuccessRate(), made_drive(on_x(xs), motion=motion, estimates=estimates))["success"]


@pytest.mark.parametrize(
    ("off", "good"), [((2.0, 0.0), 1.0), ((2.125, 0.0), 0.0), ((0.0, 34.9), 1.0), ((0.0, 35.1), 0.0)]
)
def test_a_good_frame_is_within_two_metres_and_35_degrees(off: tuple[float, float], good: float) -> None:
    found = success([(0.0, 90.0), off])
    assert (found["within_rate"], found["at_end"]) == (good / 2, good)


@pytest.mark.parametrize(("modes", "after"), [([1.0, 0.45, 0.55], 2), ([1.0, 0.5, 1.0], 1), ([1.0, 0.45, 0.45], None)])
def test_one_mode_is_a_good_frame_in_which_it_holds_half_of_the_belief(modes: list[float], after: int | None) -> None:
    assert success([(9.0, 0.0), (0.1, 0.0), (0.1, 0.0)], modes)["unimodal_after_frames"] == after


def test_a_carried_robot_is_found_again_after_as_many_frames_as_it_was_not() -> None:
    found = success([(0.0, 0.0)] * 12 + [(7.0, 0.0)] * 4 + [(0.3, 5.0)] * 10, carried=12)
    assert (found["kidnapped_at"], found["recovered_after_frames"]) == (12, 4)
    assert success([(0.0, 0.0)] * 12 + [(7.0, 0.0)] * 14, carried=12)["recovered_after_frames"] is None


def test_without_truth_there_is_nothing_to_say() -> None:
    assert figures(SuccessRate(), made_drive([None, None])) is None


@pytest.mark.parametrize(("metres", "kidnapped"), [(1.0, False), (1.125, True), (-1.125, True)])
@pytest.mark.parametrize("sideways", [False, True])
def test_a_robot_that_odometry_misses_by_more_than_a_metre_was_kidnapped(sideways, metres, kidnapped) -> None:
    truth = np.zeros((14, 3))
    truth[2:, int(sideways)] = metres
    found = figures(SuccessRate(), made_drive(truth, truth, motion=[None, *[(0.0, 0.0, 0.0)] * 13]))["success"]
    assert found.get("kidnapped_at") == (2 if kidnapped else None)


def test_frames_are_those_of_the_log_and_the_last_kidnapping_counts() -> None:
    xs = [None] * 2 + [0.0] * 4 + [5.0] * 6 + [20.0] * 14
    believed = [((x or 0.0) + (3.0 if n < 14 else 0.5), 0.0, 0.0) for n, x in enumerate(xs)]
    stood = made_drive(on_x(xs), believed, motion=[None, *[(0.0, 0.0, 0.0)] * (len(xs) - 1)])
    assert figures(SuccessRate(), stood)["success"] == {
        "kidnapped_at": 12,
        "recovered_after_frames": 2,
        "unimodal_after_frames": 14,
        "within_rate": pytest.approx(12 / 24),
        "at_end": 1.0,
    }


def test_a_motion_that_no_odometry_measured_is_no_kidnapping() -> None:
    truth = np.zeros((14, 3))
    truth[2:, 0] = 5.0
    assert "kidnapped_at" not in figures(SuccessRate(), made_drive(truth, truth))["success"]
