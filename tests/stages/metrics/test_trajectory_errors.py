import numpy as np
import pytest
from measured_drives import AT_ORIGIN, Row, figures, made_drive, on_x

from omninav.pipeline import Context
from omninav.pipeline.report.headlines import headline_rows
from omninav.stages.metrics.trajectory_errors import TrajectoryErrors
from omninav.stages.values.belief import PoseEstimate
from omninav.stages.values.drive import Drive
from omninav.stages.values.pose import Pose


def off_by(*metres: float | None, truth: list[Row] | None = None, motion=None, logs=None) -> Drive:
    """Estimates at these x, with a mean a metre further; at the origin, where `truth` says nothing else."""
    estimates = [x if x is None else PoseEstimate(Pose(x, 0.0, 0.0), np.eye(3), 1.0, Pose(x + 1, 0, 0)) for x in metres]
    return made_drive(truth or [AT_ORIGIN] * len(metres), motion=motion, logs=logs, estimates=estimates)


def measured(drive: Drive, **parameters) -> dict:
    return figures(TrajectoryErrors(**parameters), drive)


def means(*parts: dict) -> list[float]:
    return [part["position_error_m"]["mean"] for part in parts]


def test_errors_of_five_frames_worked_by_hand():
    found = measured(off_by(0.0, 1.0, 2.0, 3.0, 4.0, truth=[(0.0, 0.0, np.radians(10))] * 5))
    # distances 0, 1, 2, 3, 4: p90 lies 0.6 of the way from 3 to 4
    assert found["position_error_m"] == pytest.approx(
        {"mean": 2.0, "std": 2.0**0.5, "median": 2.0, "p90": 3.6, "max": 4.0}
    )
    assert found["heading_error_deg"] == pytest.approx(
        {"mean": 10.0, "std": 0.0, "median": 10.0, "p90": 10.0, "max": 10.0}
    )
    assert found["loss_rate"] == 0.4  # 3 m and 4 m are above 2.5 m
    assert means(found["mean_pose"]) == [3.0]


def test_a_robot_is_lost_beyond_two_and_a_half_metres_unless_told_otherwise():
    assert measured(off_by(2.5, 2.625))["loss_rate"] == 0.5
    assert measured(off_by(0.0, 1.0), lost_m=0.5)["loss_rate"] == 0.5


def test_convergence_is_the_first_of_ten_good_frames_and_the_errors_after_it_stand_apart():
    found = measured(off_by(*[5.0] * 3, *[0.5] * 12))
    assert found["converged_after_frames"] == 3
    assert found["after_convergence"]["position_error_m"]["max"] == 0.5
    assert found["after_convergence"]["loss_rate"] == 0.0
    assert found["loss_rate"] == pytest.approx(0.2)
    assert "after_settling" not in found


def test_a_filter_that_never_settles_says_so():
    found = measured(off_by(*[5.0] * 15))
    assert found["converged_after_frames"] is found["after_convergence"] is None


def test_the_settling_window_is_the_same_whoever_is_lost_for_how_long():
    drives = off_by(*[5.0] * 2, *[0.5] * 18), off_by(*[5.0] * 8, *[0.5] * 12)
    found = [measured(drive, settle_steps=5) for drive in drives]
    assert means(*(each["after_convergence"] for each in found)) == [0.5, 0.5]
    # of the 15 frames from the sixth on the slow one is lost in three
    assert means(*(each["after_settling"] for each in found)) == pytest.approx([0.5, 1.4])
    assert [each["after_settling"]["loss_rate"] for each in found] == pytest.approx([0.0, 0.2])
    assert [each["after_settling"]["frames"] for each in found] == [15, 15]


def test_the_settling_window_counts_frames_of_each_log_also_those_that_are_not_scored():
    truth = [None, None, *[AT_ORIGIN] * 4] * 2
    found = measured(off_by(*map(float, range(1, 13)), truth=truth, logs=[0] * 6 + [1] * 6), settle_steps=4)
    assert means(*(log["after_settling"] for log in found["logs"])) == [5.5, 11.5]
    assert means(found["mean_pose"]["after_settling"]) == [12.5]
    assert measured(off_by(0.0, 0.0, 0.0), settle_steps=3)["after_settling"] is None


def test_frames_without_truth_or_estimate_are_left_out_and_counted():
    truth = [AT_ORIGIN, None, AT_ORIGIN, AT_ORIGIN, AT_ORIGIN, None, AT_ORIGIN, None]
    found = measured(off_by(0.0, 99.0, None, 0.25, None, 98.0, 2.0, None, truth=truth))
    assert (found["frames"], found["frames_without_truth"], found["frames_without_estimate"]) == (8, 3, 2)
    assert found["position_error_m"] == pytest.approx(
        {"mean": 0.75, "std": np.std([0.0, 0.25, 2.0]), "median": 0.25, "p90": 1.65, "max": 2.0}
    )


def test_convergence_counts_frames_of_the_log_also_where_truth_is_missing():
    assert measured(off_by(*[0.0] * 14, truth=[None] * 4 + [AT_ORIGIN] * 10))["converged_after_frames"] == 4


def test_odometry_alone_is_measured_like_the_estimate():
    found = measured(off_by(0.0, 1.0, 2.0, 3.0, truth=on_x(range(4)), motion=[None, *[(1.5, 0.0, 0.0)] * 3]))
    assert found["position_error_m"]["max"] == 0.0
    assert found["driven_m"] == 3.0
    assert found["odometry_alone"]["final_error_m"] == 1.5
    assert found["odometry_alone"]["position_error_m"] == pytest.approx(
        {"mean": 0.75, "std": 1.25**0.5 / 2, "median": 0.75, "p90": 1.35, "max": 1.5}
    )


def test_with_several_logs_the_top_is_the_last_and_each_has_an_entry():
    found = measured(off_by(1.0, 2.0, logs=[0, 1]))
    assert means(found, *found["logs"]) == [2.0, 1.0, 2.0]


def test_the_way_is_that_of_the_true_path_in_the_plane():
    assert measured(off_by(*[0.0] * 4, truth=[AT_ORIGIN, None, (3, 4, 2.0), (3, 4, -1.0)]))["driven_m"] == 5.0


def test_where_the_robot_was_carried_it_did_not_drive():
    driven = off_by(*range(20), truth=on_x([*range(10), *range(30, 40)]), motion=[None, *[(1.0, 0.0, 0.0)] * 19])
    assert measured(driven)["driven_m"] == 18.0


def test_where_nothing_was_estimated_only_the_drive_is_told():
    found = measured(off_by(None, None, None, truth=on_x(range(3))))
    assert found == {"frames": 3, "driven_m": 2.0, "frames_without_truth": 0, "frames_without_estimate": 3}


def test_windows_say_how_many_frames_they_have_and_odometry_is_measured_over_the_same():
    metres = [x + (5.0 if x < 3 else 0.0) for x in range(15)]
    drive = off_by(*metres, truth=on_x(range(15)), motion=[None, *[(1.5, 0.0, 0.0)] * 14])
    found = measured(drive, settle_steps=14)
    assert (found["after_convergence"]["frames"], found["after_settling"]["frames"]) == (12, 1)
    assert found["odometry_alone"]["after_settling"]["position_error_m"]["max"] == 7.0
    assert means(found["odometry_alone"]["after_convergence"], found["mean_pose"]["after_convergence"]) == [4.25, 1.0]


def test_the_first_figures_say_how_far_off_whether_lost_and_when_it_converged():
    def first(*off: float) -> list[tuple[str, str, bool]]:
        metrics = TrajectoryErrors(lost_m=2.0).step(Context("errors"), off_by(*off)).metrics
        return [(row.name, row.text, row.off) for row in headline_rows(metrics, {})]

    assert first(*[0.5] * 12) == [
        ("Position error, median", "0.500 m", False),
        ("Position error, 90th percentile", "0.500 m", False),
        ("Heading error, median", "0°", False),
        ("Lost, by more than 2 m", "0 %", False),
        ("Converged", "at once", False),
    ]
    assert first(*[5.0] * 12)[3:] == [("Lost, by more than 2 m", "100 %", True), ("Converged", "never", True)]
    assert first(5.0, *[0.5] * 11)[4] == ("Converged", "after 1 frame", False)
    assert first(5.0, 5.0, *[0.5] * 10)[4] == ("Converged", "after 2 frames", False)


def test_one_log_has_no_list_of_logs_and_a_run_without_truth_says_so_and_counts_frames():
    blind, seen = Context("errors"), Context("errors")
    assert TrajectoryErrors().step(blind, off_by(0.0, truth=[None])).metrics.values == {"frames": 1}
    assert "no ground truth" in blind.facts["errors"]
    assert "logs" not in TrajectoryErrors().step(seen, off_by(0.0)).metrics.values
    assert "errors" not in seen.facts
    assert measured(off_by()) == {"frames": 0}
