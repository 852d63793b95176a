"""Success as in Wolf, Burgard & Burkhardt 2005: all frames count, and a carried robot is found again."""

import math

import numpy as np
import pytest
from small_run import collected

from omninav.pipeline import Context, Tick
from omninav.stages.geometry.plane.se2 import compose
from omninav.stages.metrics.success_rate import SuccessRate
from omninav.stages.values.belief import PoseEstimate
from omninav.stages.values.pose import Motion, Pose


def success(
    off: list[tuple[float, float]], modes: list[float] | None = None, carried: int | None = None, **options: float
):
    """The metric of a robot that drives 0.5 m a frame and is believed `off` (m aside, degrees) in each."""
    truth = [
        np.array([0.5 * n + (7.0 if carried is not None and n >= carried else 0.0), 0.0, 0.0]) for n in range(len(off))
    ]
    ticks = [Tick(n, n, 0, n, n == 0) for n in range(len(off))]
    estimates = []
    for n, (aside, degrees) in enumerate(off):
        pose = Pose(*(float(v) for v in compose(truth[n], (0.0, aside, math.radians(degrees)))))
        estimates.append(PoseEstimate(pose, np.eye(3), 1.0 if modes is None else modes[n], pose))
    motion = [None] + [Motion(0.5, 0.0, 0.0)] * (len(off) - 1)
    poses = [Pose(*(float(v) for v in each)) for each in truth]
    out = SuccessRate(**options).step(Context("success"), collected(ticks, poses, motion, estimates))
    assert out.metrics is not None
    return out.metrics.values["success"]


def test_all_frames_count_and_both_limits_hold() -> None:
    found = success([(9.0, 0.0), (1.9, 30.0), (1.9, 40.0), (0.0, 0.0), (2.1, 0.0)])
    assert found["within_rate"] == pytest.approx(2 / 5)
    assert found["at_end"] == 0.0
    assert "kidnapped_at" not in found


def test_one_mode_is_a_good_frame_in_which_it_holds_half_of_the_belief() -> None:
    assert success([(9.0, 0.0), (0.1, 0.0), (0.1, 0.0)], [1.0, 0.45, 0.55])["unimodal_after_frames"] == 2
    assert success([(9.0, 0.0), (0.1, 0.0)], [1.0, 0.45])["unimodal_after_frames"] is None


def test_a_carried_robot_is_found_again_after_as_many_frames_as_it_was_not() -> None:
    found = success([(0.0, 0.0)] * 12 + [(7.0, 0.0)] * 4 + [(0.3, 5.0)] * 10, carried=12)
    assert (found["kidnapped_at"], found["recovered_after_frames"]) == (12, 4)
    assert success([(0.0, 0.0)] * 12 + [(7.0, 0.0)] * 14, carried=12)["recovered_after_frames"] is None


def test_without_truth_there_is_nothing_to_say() -> None:
    ticks = [Tick(n, n, 0, n, n == 0) for n in range(2)]
    assert SuccessRate().step(Context("success"), collected(ticks, [None, None])).metrics is None


@pytest.mark.parametrize(
    ("off", "good"), [((2.0, 0.0), 1.0), ((2.125, 0.0), 0.0), ((0.0, 34.9), 1.0), ((0.0, 35.1), 0.0)]
)
def test_a_good_frame_is_within_two_metres_and_35_degrees(off: tuple[float, float], good: float) -> None:
    found = success([(0.0, 90.0), off])
    assert (found["within_rate"], found["at_end"]) == (good / 2, good)


def test_half_of_the_belief_is_enough() -> None:
    assert success([(9.0, 0.0), (0.1, 0.0)], [1.0, 0.5])["unimodal_after_frames"] == 1


@pytest.mark.parametrize(("metres", "kidnapped"), [(1.0, False), (1.125, True), (-1.125, True)])
def test_a_robot_that_odometry_misses_by_more_than_a_metre_was_kidnapped(metres: float, kidnapped: bool) -> None:
    for sideways in (False, True):
        truth = [Pose(0.0, 0.0, 0.0)] * 2 + [Pose(0.0, metres, 0.0) if sideways else Pose(metres, 0.0, 0.0)] * 12
        estimates = [PoseEstimate(pose, np.eye(3), 1.0, pose) for pose in truth]
        ticks = [Tick(n, n, 0, n, n == 0) for n in range(14)]
        found = SuccessRate().step(Context("s"), collected(ticks, truth, None, estimates)).metrics.values["success"]
        assert found.get("kidnapped_at") == (2 if kidnapped else None)


def test_frames_are_those_of_the_log_and_the_last_kidnapping_counts() -> None:
    path = [0.0] * 4 + [5.0] * 6 + [20.0] * 14
    truth = [None, None, *[Pose(x, 0.0, 0.0) for x in path]]
    seen = [Pose(x + (3.0 if n < 14 else 0.5), 0.0, 0.0) for n, x in enumerate([0.0, 0.0, *path])]
    estimates = [PoseEstimate(pose, np.eye(3), 1.0, pose) for pose in seen]
    ticks = [Tick(n, n, 0, n, n == 0) for n in range(26)]
    found = SuccessRate().step(Context("s"), collected(ticks, truth, None, estimates)).metrics.values["success"]
    assert (found["kidnapped_at"], found["recovered_after_frames"]) == (12, 2)
    assert found["unimodal_after_frames"] == 14
    assert found["within_rate"] == pytest.approx(12 / 24)
