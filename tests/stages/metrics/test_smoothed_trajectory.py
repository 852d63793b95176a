"""What is seen later tells where the robot was before."""

from pathlib import Path

import numpy as np
import pytest
from measured_drives import AT_ORIGIN, made_drive
from small_run import small_run

from omninav.pipeline import Context
from omninav.stages.geometry.plane.pose_errors import position_errors
from omninav.stages.geometry.plane.se2 import chain
from omninav.stages.metrics.smoothed_trajectory import SmoothTrajectory
from omninav.stages.metrics.smoothing import contradicted, smoothed, smoothed_with_lag
from omninav.stages.plots.trajectory_file import TrajectoryFile
from omninav.stages.values.belief import PoseEstimate
from omninav.stages.values.confidence import PoseConfidence
from omninav.stages.values.pose import Pose

FRAMES = 80
CTX = Context("smoothing")


def driven(seed: int = 0, lost: int = 20) -> tuple[np.ndarray, ...]:
    """A round: the truth, estimates 0.2 m off that lie elsewhere in the first frames, their covariances, motions."""
    rng = np.random.default_rng(seed)
    motions = np.tile((0.25, 0.0, 2 * np.pi / FRAMES), (FRAMES, 1))
    motions[0] = 0.0
    truth = chain(motions)
    estimates = truth + rng.normal(0.0, (0.2, 0.2, 0.05), (FRAMES, 3))
    estimates[:lost, :2] += rng.normal(0.0, 5.0, (lost, 2))
    covariances = np.tile(np.diag([0.04, 0.04, 0.0025]), (FRAMES, 1, 1))
    return truth, estimates, covariances, motions + rng.normal(0.0, 0.002, (FRAMES, 3))


def test_frames_before_the_filter_found_itself_are_put_right_and_the_others_get_better():
    truth, estimates, covariances, motions = driven()
    found = smoothed(estimates, covariances, np.ones(FRAMES), motions)
    before, after = position_errors(estimates, truth), position_errors(found, truth)
    assert after[:20].max() < 0.5 < np.median(before[:20])
    assert after[20:].mean() < 0.6 * before[20:].mean()


def test_a_pose_told_some_frames_late_is_by_a_window_before_it_and_the_frames_since():
    _, estimates, covariances, motions = (part[:12] for part in driven(lost=0))
    trust = np.linspace(0.5, 1.0, 12)
    estimates[:3] = np.nan
    found = smoothed_with_lag(estimates, covariances, trust, motions, 2, 4)
    for frame, part in ((1, slice(0, 4)), (7, slice(3, 10)), (11, slice(7, 12))):
        alone = smoothed(estimates[part], covariances[part], trust[part], motions[part])
        assert found[frame] == pytest.approx(alone[frame - part.start])
    assert np.isnan(found[0]).all()  # neither it nor the two after it have an estimate


def test_odometry_is_doubted_where_trusted_estimates_on_both_sides_contradict_it():
    truth, estimates, covariances, motions = driven(lost=0)
    carried = estimates + np.where(np.arange(FRAMES) >= 40, 8.0, 0.0)[:, None] * (1.0, 0.0, 0.0)
    assert np.flatnonzero(contradicted(carried, np.ones(FRAMES), motions[1:])).tolist() == [39]
    assert not contradicted(estimates, np.ones(FRAMES), motions[1:]).any()
    found = smoothed(carried, covariances, np.ones(FRAMES), motions)
    moved = truth + np.where(np.arange(FRAMES) >= 40, 8.0, 0.0)[:, None] * (1.0, 0.0, 0.0)
    assert position_errors(found, moved).max() < 0.5


@pytest.mark.parametrize("scale", [0.5, 1.2, 2.0])
def test_odometry_of_another_length_makes_estimates_no_worse(scale):
    truth, estimates, covariances, motions = driven(lost=0)
    found = smoothed(estimates, covariances, np.ones(FRAMES), motions * (scale, scale, 1.0))
    assert position_errors(found, truth).mean() < position_errors(estimates, truth).mean()


def test_frames_without_an_estimate_follow_odometry():
    truth, estimates, covariances, motions = driven(lost=0)
    estimates[30:40] = np.nan
    found = smoothed(estimates, covariances, np.ones(FRAMES), motions)
    assert position_errors(found, truth)[30:40].max() < 0.4


def test_every_log_is_smoothed_and_written(tmp_path: Path):
    drive = small_run(frames=40, logs=2).drive
    out = SmoothTrajectory().step(CTX, drive)
    assert out.drive is not None
    assert (
        out.metrics.values["smoothed"]["position_error_m"]["mean"]
        < position_errors(drive.last_log.estimate, drive.last_log.truth).mean() + 0.01
    )
    TrajectoryFile(name="trajectory_smoothed").step(Context("file", folder=tmp_path), out.drive)
    assert len((tmp_path / "trajectory_smoothed.tum").read_text().splitlines()) == 40
    assert (tmp_path / "trajectory_smoothed_0.tum").is_file()


def test_without_odometry_nothing_is_smoothed():
    assert SmoothTrajectory().step(CTX, made_drive([AT_ORIGIN] * 3, [AT_ORIGIN] * 3)).drive is None
    assert SmoothTrajectory(lag=2).step(CTX, small_run(frames=12).blind).metrics is None


def test_one_estimate_is_kept_as_it_is():
    estimates = np.array([[1.0, 2.0, 0.3]])
    found = smoothed(estimates, np.eye(3)[None], np.ones(1), np.zeros((1, 3)))
    assert found == pytest.approx(estimates)


def beside(confidence: float | None = None, frame: int = 0, lost_m: float = 2.5) -> np.ndarray:
    """The smoothed drive of a robot whose estimates lie 3 m to the side from a frame on, with this confidence."""
    truth, _, covariances, motions = driven(lost=0)
    estimates = truth + np.where(np.arange(FRAMES) >= frame, 3.0, 0.0)[:, None] * (0.0, 1.0, 0.0)
    rows = zip(estimates.tolist(), covariances, strict=True)
    seen = [PoseEstimate(Pose(*row), covariance, 1.0, Pose(*row)) for row, covariance in rows]
    told = [None if confidence is None or k < frame else PoseConfidence(confidence) for k in range(FRAMES)]
    drive = made_drive(truth, motion=[None, *motions[1:]], estimates=seen, confidences=told)
    return SmoothTrajectory(lost_m=lost_m).step(CTX, drive)


def test_an_estimate_weighs_as_its_confidence_says_and_fully_without_one():
    none, full, little = (beside(each, 50).drive.estimate for each in (None, 1.0, 0.001))
    assert np.array_equal(none, full)
    assert not np.allclose(none, little)


def test_smoothed_errors_are_lost_beyond_two_and_a_half_metres_unless_told_otherwise():
    assert beside().metrics.values["smoothed"]["loss_rate"] == 1.0
    assert beside(lost_m=3.5).metrics.values["smoothed"]["loss_rate"] == 0.0
