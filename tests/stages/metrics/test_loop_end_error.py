import numpy as np
import pytest
from measured_drives import figures, made_drive, on_x

from omninav.stages.metrics.loop_end_error import LoopEndError

MODULE = "omninav.stages.metrics.loop_end_error"


def test_the_error_at_home_is_that_of_the_frames_at_the_end_of_each_lap(monkeypatch: pytest.MonkeyPatch):
    # Three rounds on a circle of 10 m, 40 frames each. The estimate is 1, 2 and 3 m too high in them.
    angles = 2 * np.pi * np.arange(121) / 40
    truth = np.column_stack([10 * np.cos(angles), 10 * np.sin(angles), angles + np.pi / 2])
    believed = [(x, y + 1.0 + n // 40, heading) for n, (x, y, heading) in enumerate(truth)]
    drive = made_drive(truth, believed, [None, *[(1.0, 0.0, 0.0)] * 120])
    monkeypatch.setattr(f"{MODULE}.FRAMES", 3)
    returns = figures(LoopEndError(), drive)["returns"]
    assert [each["step"] for each in returns] == [40, 80]
    assert [each["position_error_m"] for each in returns] == pytest.approx([2.0, 3.0])
    gap = np.hypot(*(drive.odometry_alone() - truth)[40:43, :2].T).mean()
    assert returns[0]["odometry_error_m"] == pytest.approx(gap)
    assert gap > 30.0  # odometry alone goes straight on


def test_nothing_is_measured_without_truth():
    assert figures(LoopEndError(), made_drive([None])) is None


def test_five_frames_at_home_count_of_the_last_log_and_frames_without_truth_or_estimate_do_not(
    monkeypatch: pytest.MonkeyPatch,
):
    # Out to 4.5 m and back, twice; the estimate is off by the frame's number.
    xs = [50.0, None, 0.0, 4.5, 0.5, 0.0, 0.5, 1.0, 1.5, 2.0, 4.5, 0.0]
    believed = [None if n == 7 else (x or 0.0, n, 0.0) for n, x in enumerate(xs)]
    drive = made_drive(on_x(xs), believed, logs=[0] + [1] * 11)
    # Home at frame 5 of the run, which is frame 4 of its log; then frames 6, 8, 9, 10.
    home = {"step": 4, "position_error_m": pytest.approx(38 / 5), "odometry_error_m": None}
    assert figures(LoopEndError(), drive)["returns"] == [home]
    monkeypatch.setattr(f"{MODULE}.FRAMES", 1)
    monkeypatch.setattr("omninav.stages.metrics.error_curves.HOME_M", 2.2)
    assert figures(LoopEndError(), drive)["returns"][0]["position_error_m"] == 5.0
    monkeypatch.setattr("omninav.stages.metrics.error_curves.HOME_M", 2.3)
    assert figures(LoopEndError(), drive)["returns"] == []


def test_home_is_within_two_metres_of_the_start():
    xs = (0.0, 4.5, 1.5, 4.5)
    returns = figures(LoopEndError(), made_drive(on_x(xs), on_x(xs, 0.25)))["returns"]
    assert returns == [{"step": 2, "position_error_m": 0.25, "odometry_error_m": None}]
