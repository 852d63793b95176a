import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from measured_drives import figures, made_drive, on_x
from small_run import eight, small_run

from omninav.stages.geometry.plane.se2 import compose
from omninav.stages.metrics.relative_errors import (
    RelativeErrors,
    absolute_trajectory_errors,
    pairs_apart,
    relative_pose_errors,
)


@given(st.floats(-3, 3), st.floats(-9, 9), st.floats(-9, 9))
def test_a_trajectory_moved_as_a_whole_has_no_absolute_error(turn, x, y):
    truth = eight(30)
    moved = compose(np.array([x, y, turn]), truth)
    np.testing.assert_allclose(absolute_trajectory_errors(moved, truth), 0.0, atol=1e-9)


def test_pairs_are_the_first_frames_that_lie_far_enough_apart_along_the_path():
    truth = np.zeros((6, 3))
    truth[:, 0] = [0.0, 0.4, 0.8, 1.2, 1.2, 2.2]
    starts, ends = pairs_apart(truth, 1.0)
    assert list(zip(starts.tolist(), ends.tolist(), strict=True)) == [(0, 3), (1, 5), (2, 5), (3, 5), (4, 5)]


def test_relative_errors_agree_with_matrices_multiplied_one_by_one():
    rng = np.random.default_rng(1)
    truth, estimate = rng.normal(size=(12, 3)), rng.normal(size=(12, 3))
    starts, ends = np.array([0, 3, 5]), np.array([2, 9, 11])
    metres, degrees = relative_pose_errors(estimate, truth, starts, ends)

    def matrix(p):
        return np.array([[np.cos(p[2]), -np.sin(p[2]), p[0]], [np.sin(p[2]), np.cos(p[2]), p[1]], [0, 0, 1]])

    for number, (i, j) in enumerate(zip(starts, ends, strict=True)):
        true = np.linalg.inv(matrix(truth[i])) @ matrix(truth[j])
        thought = np.linalg.inv(matrix(estimate[i])) @ matrix(estimate[j])
        error = np.linalg.inv(true) @ thought  # Sturm et al. 2012, equation for E_i
        assert metres[number] == pytest.approx(np.hypot(error[0, 2], error[1, 2]))
        assert degrees[number] == pytest.approx(abs(np.degrees(np.arctan2(error[1, 0], error[0, 0]))))


def test_figures_of_errors_worked_by_hand():
    truth = np.array(on_x(range(4)))
    estimate = np.add(truth, [(0.0, 1.0, 0.0), (0.0, -1.0, 0.1), (0.0, -1.0, 0.1), (0.0, 1.0, 0.4)])
    drive = made_drive(truth, estimate)
    even = pytest.approx({"rmse": 1.0, "mean": 1.0, "median": 1.0, "max": 1.0})
    turns = np.degrees([0.1, 0.0, 0.3])
    found = figures(RelativeErrors(), drive)
    metres = found.pop("relative_position_error_m")
    assert found == {
        "absolute_trajectory_error_m": even,
        "unaligned_trajectory_error_m": even,
        "relative_heading_error_deg": pytest.approx(
            {"rmse": np.sqrt((turns**2).mean()), "mean": turns.mean(), "median": np.median(turns), "max": turns.max()}
        ),
        "relative_error_distance_m": 1.0,
    }
    assert metres["mean"] == pytest.approx(relative_pose_errors(estimate, truth, *pairs_apart(truth, 1.0))[0].mean())
    assert figures(RelativeErrors(), drive.at(slice(2)))["unaligned_trajectory_error_m"]["max"] == 1.0
    assert figures(RelativeErrors(), drive.at(slice(1))) == figures(RelativeErrors(), made_drive([None] * 3)) == {}


def test_only_frames_of_the_last_log_with_truth_and_estimate_are_compared_and_a_short_path_has_no_pair():
    drive = small_run(frames=20, logs=2).drive
    drive.truth[:20] += 100.0
    drive.truth[25] = np.nan
    drive.estimate[30] = np.nan
    found = figures(RelativeErrors(distance_m=1000.0), drive)
    assert set(found) == {"absolute_trajectory_error_m", "unaligned_trajectory_error_m"}
    scored = [row for row in range(20, 40) if row not in (25, 30)]
    away = np.hypot(*(drive.estimate - drive.truth)[scored, :2].T)
    assert found["unaligned_trajectory_error_m"]["mean"] == pytest.approx(away.mean())


def test_a_pair_lies_exactly_a_metre_apart():
    truth = np.zeros((21, 3))
    truth[:, 1] = np.arange(21) * 0.1
    starts, ends = pairs_apart(truth, 1.0)
    assert (ends - starts).tolist() == [10] * 11
