import numpy as np
import pytest
from small_run import small_run

from omninav.pipeline import Tick
from omninav.stages.values.drives import drives, known
from omninav.stages.values.pose import Motion, Pose


def straight(truth, motion):
    ticks = [Tick(i, i * 10**9, 0, i, i == 0) for i in range(len(truth))]
    return drives(ticks, [None] * len(ticks), truth, motion)[0]


def test_a_run_is_cut_where_the_log_changes_and_keeps_the_frames_numbers():
    run = small_run(frames=12, logs=3)
    found = drives(*run.drive)
    assert [drive.log for drive in found] == [0, 1, 2]
    assert all(drive.frames.tolist() == list(range(12)) for drive in found)


def test_absent_values_are_rows_of_nan():
    drive = straight([Pose(0, 0, 0), None, Pose(2, 0, 0)], [None, None, None])
    assert known(drive.truth).tolist() == [True, False, True]
    assert not known(drive.estimate).any()


def test_odometry_alone_starts_at_the_first_true_pose_and_adds_up_motions_worked_by_hand():
    ahead = Motion(1.0, 0.0, 0.0)
    turn = Motion(0.0, 0.0, np.pi / 2)
    # the truth is known from the second frame on: (5, 1), heading north
    truth = [None, Pose(5, 1, np.pi / 2), Pose(0, 0, 0), Pose(0, 0, 0), Pose(0, 0, 0)]
    path = straight(truth, [None, ahead, ahead, turn, ahead]).odometry_alone()
    expected = [[5, 0, np.pi / 2], [5, 1, np.pi / 2], [5, 2, np.pi / 2], [5, 2, -np.pi], [4, 2, -np.pi]]
    np.testing.assert_allclose(path, expected, atol=1e-12)


def test_a_frame_without_motion_did_not_move():
    path = straight([Pose(0, 0, 0)] * 3, [None, None, Motion(1, 0, 0)]).odometry_alone()
    np.testing.assert_allclose(path[:, 0], [0, 0, 1])


def test_without_motion_there_is_no_odometry_alone():
    assert straight([Pose(0, 0, 0)] * 2, [None, None]).odometry_alone() is None


def test_without_truth_odometry_alone_is_laid_through_the_last_estimate():
    run = small_run(frames=20)
    drive = drives(run.ticks, run.estimates, [None] * 20, run.motion)[0]
    np.testing.assert_allclose(drive.odometry_alone()[-1], drive.estimate[-1], atol=1e-12)


def test_sequences_of_different_length_are_an_error():
    with pytest.raises(ValueError, match="shorter"):
        drives([Tick(0, 0)], [], [], [])
