"""Right from the first time on that it was; and where the belief's mean lies at first."""

import math

import numpy as np
import pytest
from small_run import collected

from omninav.pipeline import Context, Tick
from omninav.stages.metrics.initial_mean import InitialMean
from omninav.stages.metrics.tracking_success import TrackingSuccess
from omninav.stages.values.belief import PoseEstimate
from omninav.stages.values.drive import Drive
from omninav.stages.values.grid import FreeSpace
from omninav.stages.values.pose import Pose


def believed(off: list[tuple[float, float]]) -> Drive:
    """A robot at the origin that is believed `off` (m aside, degrees) in each frame, with means twice as far aside."""
    ticks = [Tick(n, n, 0, n, n == 0) for n in range(len(off))]
    estimates = [
        PoseEstimate(Pose(0.0, aside, math.radians(turned)), np.eye(3), 1.0, Pose(0.0, 2 * aside, 0.0))
        for aside, turned in off
    ]
    return collected(ticks, [Pose(0.0, 0.0, 0.0)] * len(off), None, estimates)


def tracking_success(off: list[tuple[float, float]]):
    out = TrackingSuccess().step(Context("tracking_success"), believed(off))
    assert out.metrics is not None
    return out.metrics.values["tracking_success"]


def test_frames_before_the_first_right_one_do_not_count() -> None:
    found = tracking_success([(9.0, 0.0), (1.0, 40.0), (1.9, 34.5), (2.1, 0.0), (0.0, 0.0), (0.0, 36.0)])
    assert found == {"after_frames": 2, "right_rate": pytest.approx(2 / 4)}


def test_a_robot_that_was_never_right_has_no_share() -> None:
    assert tracking_success([(9.0, 0.0), (1.0, 40.0)]) == {"after_frames": None, "right_rate": None}


def test_an_estimate_at_the_limits_is_right(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("omninav.stages.metrics.success_rate.WITHIN_DEG", 90.0)
    out = TrackingSuccess().step(Context("tracking_success"), believed([(2.0, 90.0), (2.0, -91.0)]))
    assert out.metrics is not None
    assert out.metrics.values["tracking_success"] == {"after_frames": 0, "right_rate": 0.5}


def test_frames_without_truth_are_not_judged_and_those_without_estimate_are_not_right() -> None:
    drive = believed([(0.0, 0.0), (9.0, 0.0), (0.0, 0.0), (0.0, 0.0)])
    drive.truth[0] = np.nan
    drive.estimate[3] = np.nan
    out = TrackingSuccess().step(Context("tracking_success"), drive)
    assert out.metrics is not None
    assert out.metrics.values["tracking_success"] == {"after_frames": 2, "right_rate": 0.5}
    drive.truth[:] = np.nan
    assert TrackingSuccess().step(Context("tracking_success"), drive).metrics is None


def test_the_mean_counts_from_the_middle_of_the_free_cells() -> None:
    free = FreeSpace(np.array([[0.0, 0.0], [6.0, 0.0], [0.0, 9.0]]), 1.0)  # their mean is (2, 3)
    out = InitialMean().step(Context("mean"), believed([(3.5, 0.0), (0.0, 0.0)]), free)
    assert out.metrics is not None
    assert out.metrics.values["initial_mean"]["from_middle_m"] == pytest.approx(math.hypot(2.0, 4.0))


def test_the_first_mean_is_that_of_the_first_frame_that_has_one() -> None:
    free = FreeSpace(np.array([[1.0, 3.0], [3.0, 3.0]]), 1.0)
    drive = believed([(0.0, 0.0), (3.5, 0.0), (0.0, 0.0)])
    drive.mean[0] = np.nan
    out = InitialMean().step(Context("mean"), drive, free)
    assert out.metrics is not None
    assert out.metrics.values["initial_mean"]["from_middle_m"] == pytest.approx(math.hypot(2.0, 4.0))
    drive.mean[:] = np.nan
    assert InitialMean().step(Context("mean"), drive, free).metrics is None
