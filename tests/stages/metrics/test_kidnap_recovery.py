import numpy as np
import pytest
from small_run import collected

from omninav.pipeline import Context, Tick
from omninav.stages.metrics.kidnap_recovery import KidnapRecovery
from omninav.stages.values.belief import PoseEstimate
from omninav.stages.values.pose import Motion, Pose

CTX = Context("metric")


def lifted_drive(wrong_for: int | None):
    """Forty frames of half a metre and two seconds. Before frame 12 it is turned by half a radian, which odometry does
    not see, and its estimate is wrong for so many frames (None: to the end)."""
    turned = [0.5 * (n >= 12) for n in range(40)]
    path = np.cumsum([[0.5 * np.cos(turn), 0.5 * np.sin(turn)] for turn in turned], axis=0)
    truth = [Pose(x, y, turn) for (x, y), turn in zip(path.tolist(), turned, strict=True)]
    motion = [None, *(Motion(0.5, 0.0, 0.0) for _ in range(39))]
    until = 40 if wrong_for is None else 12 + wrong_for
    poses = [Pose(true.x, true.y, 0.0 if n < until else true.heading) for n, true in enumerate(truth)]
    estimates = [PoseEstimate(pose, np.eye(3), 1.0, pose) for pose in poses]
    return collected([Tick(n, 2 * n * 10**9, 0, n, n == 0) for n in range(40)], truth, motion, estimates)


def test_the_time_until_the_estimate_is_right_counts_from_the_lift():
    lifts = KidnapRecovery().step(CTX, lifted_drive(5)).metrics.values["lifts"]
    assert lifts == {"number": 1, "never": 0, "step": [12], "seconds": [10.0]}


def test_an_estimate_that_is_never_right_again_counts_to_the_end():
    lifts = KidnapRecovery().step(CTX, lifted_drive(None)).metrics.values["lifts"]
    assert (lifts["never"], lifts["seconds"]) == (1, [54.0])


def test_a_drive_without_lifts_has_none(monkeypatch: pytest.MonkeyPatch):
    drive = lifted_drive(0)
    quiet = drive.at(slice(None, 12))
    assert KidnapRecovery().step(CTX, quiet).metrics is None
    monkeypatch.setattr("omninav.stages.metrics.kidnap_recovery.JUMP_DEG", 40.0)
    assert KidnapRecovery().step(CTX, drive).metrics is None


def test_a_robot_that_is_carried_away_was_lifted():
    drive = lifted_drive(0)
    drive.motion[30, 0] = 3.0
    assert KidnapRecovery().step(CTX, drive).metrics.values["lifts"]["step"] == pytest.approx([12, 30])


@pytest.mark.parametrize(("sideways", "steps"), [(0.45, [12]), (0.55, [12, 30]), (-0.55, [12, 30])])
def test_half_a_metre_to_any_side_is_a_lift(sideways, steps):
    drive = lifted_drive(0)
    drive.motion[30, 1] = sideways
    assert KidnapRecovery().step(CTX, drive).metrics.values["lifts"]["step"] == steps


@pytest.mark.parametrize(("degrees", "steps"), [(14.5, [12]), (16.0, [12, 30]), (-16.0, [12, 30])])
def test_fifteen_degrees_to_either_side_are_a_lift(degrees, steps):
    drive = lifted_drive(0)
    drive.motion[30, 2] = np.radians(degrees)
    assert KidnapRecovery().step(CTX, drive).metrics.values["lifts"]["step"] == steps


def test_what_is_at_a_limit_is_no_lift(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("omninav.stages.metrics.kidnap_recovery.JUMP_DEG", 90.0)

    def lifts(motion: Motion):
        pose = Pose(0.0, 0.0, 0.0)
        drive = collected(
            [Tick(0, 0), Tick(1, 1)], [pose] * 2, [None, motion], [PoseEstimate(pose, np.eye(3), 1.0, pose)] * 2
        )
        return KidnapRecovery().step(CTX, drive).metrics

    assert lifts(Motion(0.0, 0.5, 0.0)) is lifts(Motion(0.0, 0.0, np.pi / 2)) is None
    assert lifts(Motion(0.0, 0.51, 0.0)).values["lifts"]["number"] == 1


def test_the_end_is_the_last_frame_that_has_truth_and_estimate():
    drive = lifted_drive(None)
    drive.estimate[39] = np.nan
    assert KidnapRecovery().step(CTX, drive).metrics.values["lifts"]["seconds"] == [52.0]


def test_frames_without_truth_or_estimate_do_not_count_and_one_frame_alone_has_no_lift():
    drive = lifted_drive(5)
    drive.estimate[38] = np.nan
    drive.truth[39] = np.nan
    assert KidnapRecovery().step(CTX, drive).metrics.values["lifts"]["seconds"] == [10.0]
    assert KidnapRecovery().step(CTX, drive.at(slice(1))).metrics is None
    assert KidnapRecovery().step(CTX, drive.at(slice(38, None))).metrics is None
