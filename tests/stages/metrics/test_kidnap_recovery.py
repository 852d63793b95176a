import numpy as np
import pytest
from measured_drives import AT_ORIGIN, figures, made_drive

from omninav.stages.metrics.kidnap_recovery import KidnapRecovery
from omninav.stages.metrics.success_rate import SuccessRate
from omninav.stages.metrics.trajectory_errors import TrajectoryErrors


def lifted_drive(wrong_for: int | None):
    """Forty frames of half a metre and two seconds. Before frame 12 it is turned by half a radian, which odometry does
    not see, and its estimate is wrong for so many frames (None: to the end)."""
    turned = 0.5 * (np.arange(40) >= 12)
    path = np.cumsum(0.5 * np.column_stack([np.cos(turned), np.sin(turned)]), axis=0)
    until = 40 if wrong_for is None else 12 + wrong_for
    believed = np.where(np.arange(40) < until, 0.0, turned)
    motion = [None, *[(0.5, 0.0, 0.0)] * 39]
    return made_drive(np.column_stack([path, turned]), np.column_stack([path, believed]), motion, every_s=2.0)


def lifts(drive):
    found = figures(KidnapRecovery(), drive)
    return found and found["lifts"]


def test_the_time_until_the_estimate_is_right_counts_from_the_lift():
    assert lifts(lifted_drive(5)) == {"number": 1, "never": 0, "step": [12], "seconds": [10.0]}


def test_an_estimate_that_is_never_right_again_counts_to_the_last_frame_that_has_truth_and_estimate():
    drive = lifted_drive(None)
    assert (lifts(drive)["never"], lifts(drive)["seconds"]) == (1, [54.0])
    drive.estimate[39] = np.nan
    assert lifts(drive)["seconds"] == [52.0]


def test_a_drive_without_lifts_has_none(monkeypatch: pytest.MonkeyPatch):
    drive = lifted_drive(0)
    assert lifts(drive.at(slice(None, 12))) is None
    monkeypatch.setattr("omninav.stages.metrics.kidnap_recovery.JUMP_DEG", 40.0)
    assert lifts(drive) is None


@pytest.mark.parametrize(
    ("column", "motion", "steps"),
    [
        pytest.param(0, 3.0, [12, 30], id="carried ahead"),
        pytest.param(1, 0.45, [12], id="almost half a metre"),
        pytest.param(1, 0.55, [12, 30], id="to the left"),
        pytest.param(1, -0.55, [12, 30], id="to the right"),
        pytest.param(2, np.radians(14.5), [12], id="almost fifteen degrees"),
        pytest.param(2, np.radians(16.0), [12, 30], id="turned to the left"),
        pytest.param(2, np.radians(-16.0), [12, 30], id="turned to the right"),
    ],
)
def test_half_a_metre_to_any_side_or_fifteen_degrees_are_a_lift(column, motion, steps):
    drive = lifted_drive(0)
    drive.motion[30, column] = motion
    assert lifts(drive)["step"] == steps


def test_what_is_at_a_limit_is_no_lift(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("omninav.stages.metrics.kidnap_recovery.JUMP_DEG", 90.0)

    def standing(*motion: float):
        return lifts(made_drive([AT_ORIGIN] * 2, [AT_ORIGIN] * 2, [None, motion]))

    assert standing(0.0, 0.5, 0.0) is standing(0.0, 0.0, np.pi / 2) is None
    assert standing(0.0, 0.51, 0.0)["number"] == 1


@pytest.mark.parametrize(("unknown", "number"), [(1, 1), (2, 1), (3, None)])
def test_a_lift_over_an_image_or_two_without_a_true_pose_is_seen(unknown: int, number: int | None):
    drive = lifted_drive(0)
    drive.truth[12:, :2] += 3.0
    drive.truth[12 : 12 + unknown] = np.nan
    found = lifts(drive)
    assert (found and found["number"], found and found["step"]) == (number, [12 + unknown] if number else None)
    driven = figures(TrajectoryErrors(), drive)["driven_m"]
    assert driven == pytest.approx(0.5 * (39 - unknown - 1), abs=0.1) or number is None


def test_odometry_of_another_unit_is_no_lift():
    drive = lifted_drive(0)
    drive.motion[1:] *= (10.0, 10.0, 1.0)
    assert lifts(drive) is None
    assert "kidnapped_at" not in figures(SuccessRate(), drive)["success"]


def test_a_gap_of_truth_or_estimate_is_no_lift_and_a_lift_while_the_estimate_is_silent_is_one():
    drive = lifted_drive(0)
    drive.truth[25:29] = drive.estimate[3:7] = np.nan
    assert lifts(drive) == {"number": 1, "never": 0, "step": [12], "seconds": [0.0]}
    drive.estimate[10:15] = np.nan
    assert lifts(drive) == {"number": 1, "never": 0, "step": [12], "seconds": [6.0]}
    drive.estimate[12:] = np.nan
    assert lifts(drive) == {"number": 1, "never": 1, "step": [12], "seconds": [0.0]}


def test_frames_without_truth_or_estimate_do_not_count_and_one_frame_alone_has_no_lift():
    drive = lifted_drive(5)
    drive.estimate[38] = np.nan
    drive.truth[39] = np.nan
    assert lifts(drive)["seconds"] == [10.0]
    assert lifts(drive.at(slice(1))) is lifts(drive.at(slice(38, None))) is None
