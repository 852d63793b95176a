import numpy as np
import pytest
from small_run import collected, small_run

from omninav.pipeline import Context, Tick
from omninav.pipeline.report.key_figures import key_figures
from omninav.stages.metrics.trajectory_errors import TrajectoryErrors
from omninav.stages.values.belief import PoseEstimate
from omninav.stages.values.pose import Motion, Pose


def at(x, y=0.0, heading=0.0):
    return PoseEstimate(Pose(x, y, heading), np.eye(3), 1.0, Pose(x + 1.0, y, heading))


def measured(estimates, truth, motion=None, logs=None, **parameters):
    logs = logs or [0] * len(truth)
    ticks = [Tick(i, i * 10**9, log, i) for i, log in enumerate(logs)]
    motion = motion or [None] * len(truth)
    return (
        TrajectoryErrors(**parameters)
        .step(Context("errors"), collected(ticks, truth, motion, estimates))
        .metrics.values
    )


def test_errors_of_five_frames_worked_by_hand():
    found = measured([at(x) for x in (0.0, 1.0, 2.0, 3.0, 4.0)], [Pose(0, 0, np.radians(10))] * 5)
    # distances 0, 1, 2, 3, 4: p90 lies 0.6 of the way from 3 to 4
    assert found["position_error_m"] == pytest.approx(
        {"mean": 2.0, "std": 2.0**0.5, "median": 2.0, "p90": 3.6, "max": 4.0}
    )
    assert found["heading_error_deg"] == pytest.approx(
        {"mean": 10.0, "std": 0.0, "median": 10.0, "p90": 10.0, "max": 10.0}
    )
    assert found["loss_rate"] == 0.4  # 3 m and 4 m are above 2.5 m
    assert found["mean_pose"]["position_error_m"]["mean"] == 3.0


def test_lost_is_what_its_parameter_says():
    assert measured([at(0.0), at(1.0)], [Pose(0, 0, 0)] * 2, lost_m=0.5)["loss_rate"] == 0.5


def test_convergence_is_the_first_of_ten_good_frames_and_the_errors_after_it_stand_apart():
    far, near = [at(5.0)] * 3, [at(0.5)] * 12
    found = measured(far + near, [Pose(0, 0, 0)] * 15)
    assert found["converged_after_frames"] == 3
    assert found["after_convergence"]["position_error_m"]["max"] == 0.5
    assert found["after_convergence"]["loss_rate"] == 0.0
    assert found["loss_rate"] == pytest.approx(0.2)


def test_a_filter_that_never_settles_says_so():
    found = measured([at(5.0)] * 15, [Pose(0, 0, 0)] * 15)
    assert found["converged_after_frames"] is None
    assert found["after_convergence"] is None


def test_the_settling_window_is_the_same_whoever_is_lost_for_how_long():
    quick, slow = [at(5.0)] * 2 + [at(0.5)] * 18, [at(5.0)] * 8 + [at(0.5)] * 12
    truth = [Pose(0, 0, 0)] * 20
    found = [measured(estimates, truth, settle_steps=5) for estimates in (quick, slow)]
    assert [each["after_convergence"]["position_error_m"]["mean"] for each in found] == [0.5, 0.5]
    # of the 15 frames from the sixth on the slow one is lost in three
    assert [each["after_settling"]["position_error_m"]["mean"] for each in found] == pytest.approx([0.5, 1.4])
    assert [each["after_settling"]["loss_rate"] for each in found] == pytest.approx([0.0, 0.2])
    assert [each["after_settling"]["frames"] for each in found] == [15, 15]


def test_the_settling_window_counts_frames_of_each_log_also_those_that_are_not_scored():
    truth = [None, None, *[Pose(0, 0, 0)] * 4] * 2
    found = measured([at(float(x)) for x in range(12)], truth, logs=[0] * 6 + [1] * 6, settle_steps=4)
    assert [log["after_settling"]["position_error_m"]["mean"] for log in found["logs"]] == [4.5, 10.5]
    assert found["mean_pose"]["after_settling"]["position_error_m"]["mean"] == 11.5
    assert measured([at(0.0)] * 3, [Pose(0, 0, 0)] * 3, settle_steps=3)["after_settling"] is None


def test_without_a_settling_window_nothing_is_said_of_one():
    assert "after_settling" not in measured([at(0.0)] * 3, [Pose(0, 0, 0)] * 3)


def test_frames_without_truth_or_estimate_are_left_out_and_counted():
    estimates = [at(0.0), at(99.0), None, at(0.25), None, at(98.0), at(2.0), None]
    truth = [Pose(0, 0, 0), None, Pose(0, 0, 0), Pose(0, 0, 0), Pose(0, 0, 0), None, Pose(0, 0, 0), None]
    found = measured(estimates, truth)
    assert (found["frames"], found["frames_without_truth"], found["frames_without_estimate"]) == (8, 3, 2)
    assert found["position_error_m"] == pytest.approx(
        {"mean": 0.75, "std": np.std([0.0, 0.25, 2.0]), "median": 0.25, "p90": 1.65, "max": 2.0}
    )


def test_convergence_counts_frames_of_the_log_also_where_truth_is_missing():
    truth = [None] * 4 + [Pose(0, 0, 0)] * 10
    assert measured([at(0.0)] * 14, truth)["converged_after_frames"] == 4


def test_without_truth_only_frames_are_counted():
    assert measured([at(0.0)] * 3, [None] * 3) == {"frames": 3}


def test_odometry_alone_is_measured_like_the_estimate():
    truth = [Pose(float(x), 0.0, 0.0) for x in range(4)]
    motion = [None, *[Motion(1.5, 0.0, 0.0)] * 3]
    found = measured([at(float(x)) for x in range(4)], truth, motion)
    assert found["position_error_m"]["max"] == 0.0
    assert found["driven_m"] == 3.0
    assert found["odometry_alone"]["final_error_m"] == 1.5
    assert found["odometry_alone"]["position_error_m"] == pytest.approx(
        {"mean": 0.75, "std": 1.25**0.5 / 2, "median": 0.75, "p90": 1.35, "max": 1.5}
    )


def test_with_several_logs_the_top_is_the_last_and_each_has_an_entry():
    found = measured([at(1.0), at(2.0)], [Pose(0, 0, 0)] * 2, logs=[0, 1])
    assert found["position_error_m"]["mean"] == 2.0
    assert [log["position_error_m"]["mean"] for log in found["logs"]] == [1.0, 2.0]


def test_an_empty_run_has_no_frames():
    assert measured([], []) == {"frames": 0}


def test_a_filter_that_finds_itself_converges():
    run = small_run(frames=60)
    found = TrajectoryErrors().step(Context("errors"), run.drive).metrics.values
    assert found["converged_after_frames"] < 20
    assert found["after_convergence"]["position_error_m"]["median"] < 0.2


def test_a_robot_is_lost_beyond_two_and_a_half_metres():
    assert measured([at(2.5), at(2.625)], [Pose(0, 0, 0)] * 2)["loss_rate"] == 0.5


def test_the_way_is_that_of_the_true_path_in_the_plane():
    truth = [Pose(0, 0, 0), None, Pose(3, 4, 2.0), Pose(3, 4, -1.0)]
    found = measured([at(0.0)] * 4, truth)
    assert found["driven_m"] == 5.0
    assert found["after_convergence"] is found["converged_after_frames"] is None


def test_where_nothing_was_estimated_only_the_drive_is_told():
    found = measured([None] * 3, [Pose(float(x), 0, 0) for x in range(3)])
    assert found == {"frames": 3, "driven_m": 2.0, "frames_without_truth": 0, "frames_without_estimate": 3}


def test_windows_say_how_many_frames_they_have_and_odometry_is_measured_over_the_same():
    truth = [Pose(float(x), 0.0, 0.0) for x in range(15)]
    motion = [None, *[Motion(1.5, 0.0, 0.0)] * 14]
    estimates = [at(x + (5.0 if x < 3 else 0.0)) for x in range(15)]
    found = measured(estimates, truth, motion, settle_steps=14)
    assert (found["after_convergence"]["frames"], found["after_settling"]["frames"]) == (12, 1)
    assert found["odometry_alone"]["after_convergence"]["position_error_m"]["mean"] == pytest.approx(4.25)
    assert found["odometry_alone"]["after_settling"]["position_error_m"]["max"] == 7.0
    assert found["mean_pose"]["after_convergence"]["position_error_m"]["mean"] == 1.0


def test_the_first_figures_say_how_far_off_whether_lost_and_when_it_converged():
    def first(*off: float) -> list[tuple[str, str, bool]]:
        drive = collected([Tick(i, i, 0, i) for i in range(12)], [Pose(0, 0, 0)] * 12, None, [*map(at, off)])
        metrics = TrajectoryErrors(lost_m=2.0).step(Context("errors"), drive).metrics
        return [(figure.name, figure.text, figure.off) for figure in key_figures(metrics, {})]

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


def test_one_log_has_no_list_of_logs_and_a_run_without_truth_says_so():
    ctx = Context("errors")
    blind = collected([Tick(0, 0)], [None], None, [at(0.0)])
    assert "logs" not in TrajectoryErrors().step(ctx, blind).metrics.values
    assert "no ground truth" in ctx.facts["errors"]
    ctx = Context("errors")
    seen = TrajectoryErrors().step(ctx, collected([Tick(0, 0)], [Pose(0, 0, 0)], None, [at(0.0)])).metrics.values
    assert "logs" not in seen
    assert "errors" not in ctx.facts
