import numpy as np
import pytest
from small_run import collected, small_run

from omninav.pipeline import Tick
from omninav.stages.values.drive import known
from omninav.stages.values.pose import Motion, Pose


def straight(truth, motion):
    return collected([Tick(i, i * 10**9, 0, i, i == 0) for i in range(len(truth))], truth, motion)


def test_a_drive_is_cut_where_the_log_changes_and_keeps_the_numbers_of_ticks_and_frames():
    logs = small_run(frames=12, logs=3).drive.by_log
    assert [set(log.log.tolist()) for log in logs] == [{0}, {1}, {2}]
    assert all(log.frames.tolist() == list(range(12)) for log in logs)
    assert [row for log in logs for row in log.row.tolist()] == list(range(36))


def test_the_last_log_is_the_one_that_ended_last_and_seconds_count_from_its_first_frame():
    last = small_run(frames=12, logs=3).drive.last_log
    assert last.row.tolist() == list(range(24, 36))
    assert last.seconds.tolist() == pytest.approx([0.1 * k for k in range(12)])


def test_a_drive_without_ticks_has_no_log():
    nothing = collected([], [])
    assert nothing.by_log == []
    assert len(nothing.last_log) == 0
    assert not nothing.has_truth


def test_absent_values_are_rows_of_nan():
    drive = straight([Pose(0, 0, 0), None, Pose(2, 0, 0)], [None, None, None])
    assert known(drive.truth).tolist() == [True, False, True]
    assert not known(drive.estimate).any()
    assert np.isnan(drive.distance).all()


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
    drive = small_run(frames=20).blind
    np.testing.assert_allclose(drive.odometry_alone()[-1], drive.estimate[-1], atol=1e-12)
