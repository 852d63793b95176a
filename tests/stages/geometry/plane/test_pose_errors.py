import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from omninav.stages.geometry.plane.pose_errors import first_settled, heading_errors_deg, position_errors
from omninav.stages.geometry.plane.se2 import chain, compose


def test_errors_worked_by_hand():
    poses, truth = np.array([[3.0, 4.0, np.radians(170)]]), np.array([[0.0, 0.0, np.radians(-170)]])
    assert position_errors(poses, truth).tolist() == [5.0]
    np.testing.assert_allclose(heading_errors_deg(poses, truth), [20.0])


def test_settling_needs_ten_frames_in_a_row_below_both_limits():
    position = np.array([3.0, *[0.5] * 9, 1.0, *[0.5] * 10, 9.0])
    heading = np.zeros(len(position))
    assert first_settled(position, heading) == 11
    heading[12] = 20.0  # a limit is not below itself
    assert first_settled(position, heading) is None
    assert first_settled(np.zeros(9), np.zeros(9)) is None
    assert first_settled(np.zeros(10), np.zeros(10)) == 0


@given(arrays(np.float64, (7, 3), elements=st.floats(-3, 3)))
def test_chained_motions_are_the_motions_composed_one_by_one(motions):
    pose, expected = np.zeros(3), []
    for motion in motions:
        pose = compose(pose, motion)
        expected.append(pose)
    found = chain(motions)
    np.testing.assert_allclose(found[:, :2], np.array(expected)[:, :2], atol=1e-9)
    np.testing.assert_allclose(np.exp(1j * found[:, 2]), np.exp(1j * np.array(expected)[:, 2]), atol=1e-9)
