import numpy as np
import pytest
from small_run import collected

from omninav.pipeline import Context, Tick
from omninav.stages.metrics.loop_end_error import LoopEndError
from omninav.stages.values.belief import PoseEstimate
from omninav.stages.values.pose import Motion, Pose


def test_the_error_at_home_is_that_of_the_frames_at_the_end_of_each_lap(monkeypatch: pytest.MonkeyPatch):
    # Three rounds on a circle of 10 m, 40 frames each. The estimate is 1, 2 and 3 m too high in them.
    angles = 2 * np.pi * np.arange(121) / 40
    truth = [Pose(10 * np.cos(a), 10 * np.sin(a), a + np.pi / 2) for a in angles.tolist()]
    poses = [Pose(true.x, true.y + 1.0 + n // 40, true.heading) for n, true in enumerate(truth)]
    estimates = [PoseEstimate(pose, np.eye(3), 1.0, pose) for pose in poses]
    motion = [None, *(Motion(1.0, 0.0, 0.0) for _ in range(120))]
    drive = collected([Tick(n, n, 0, n, n == 0) for n in range(121)], truth, motion, estimates)
    monkeypatch.setattr("omninav.stages.metrics.loop_end_error.FRAMES", 3)
    returns = LoopEndError().step(Context("metric"), drive).metrics.values["returns"]
    assert [each["step"] for each in returns] == [40, 80]
    assert [each["position_error_m"] for each in returns] == pytest.approx([2.0, 3.0])
    path = drive.odometry_alone()
    gap = np.hypot(*(path[40:43, :2] - drive.truth[40:43, :2]).T).mean()
    assert returns[0]["odometry_error_m"] == pytest.approx(gap)
    assert gap > 30.0  # odometry alone goes straight on


def test_nothing_is_measured_without_truth():
    assert LoopEndError().step(Context("metric"), collected([Tick(0, 0)], [None])).metrics is None


def test_five_frames_at_home_count_of_the_last_log_and_frames_without_truth_or_estimate_do_not(
    monkeypatch: pytest.MonkeyPatch,
):
    # Out to 4.5 m and back, twice; the estimate is off by the frame's number.
    xs = [0.0, 4.5, 0.5, 0.0, 0.5, 1.0, 1.5, 2.0, 4.5, 0.0]
    truth = [Pose(50.0, 0.0, 0.0), None, *[Pose(x, 0.0, 0.0) for x in xs]]
    poses = [Pose(x, float(n), 0.0) for n, x in enumerate([50.0, 0.0, *xs])]
    estimates = [PoseEstimate(pose, np.eye(3), 1.0, pose) for pose in poses]
    estimates[7] = None
    ticks = [Tick(n, n, int(n > 0), max(n - 1, 0), n < 2) for n in range(12)]
    returns = LoopEndError().step(Context("metric"), collected(ticks, truth, None, estimates)).metrics.values["returns"]
    # Home at frame 5 of the run, which is frame 4 of its log; then frames 6, 8, 9, 10.
    assert returns == [{"step": 4, "position_error_m": pytest.approx(38 / 5), "odometry_error_m": None}]
    monkeypatch.setattr("omninav.stages.metrics.loop_end_error.FRAMES", 1)
    monkeypatch.setattr("omninav.stages.metrics.loop_end_error.HOME_M", 2.2)
    few = LoopEndError().step(Context("m"), collected(ticks, truth, None, estimates)).metrics.values
    assert few["returns"][0]["position_error_m"] == 5.0
    monkeypatch.setattr("omninav.stages.metrics.loop_end_error.HOME_M", 2.3)
    wide = LoopEndError().step(Context("m"), collected(ticks, truth, None, estimates)).metrics.values
    assert wide["returns"] == []


def test_home_is_within_two_metres_of_the_start():
    truth = [Pose(x, 0.0, 0.0) for x in (0.0, 4.5, 1.5, 4.5)]
    estimates = [PoseEstimate(Pose(pose.x, 0.25, 0.0), np.eye(3), 1.0, pose) for pose in truth]
    drive = collected([Tick(n, n, 0, n) for n in range(4)], truth, None, estimates)
    returns = LoopEndError().step(Context("metric"), drive).metrics.values["returns"]
    assert returns == [{"step": 2, "position_error_m": 0.25, "odometry_error_m": None}]
