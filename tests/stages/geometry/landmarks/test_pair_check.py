import math

import numpy as np
import pytest

from omninav.stages.geometry.landmarks.pair_check import fit_motion

MOTION = np.array([0.9, -0.5, 2.1])
TOLERANCE = math.radians(0.35)


@pytest.fixture(scope="module")
def seen():
    """Points of a room as they are seen before and after a motion."""
    points = np.random.default_rng(0).uniform([-4, -3, -1], [4, 3, 2], (400, 3))
    points = points[np.hypot(*points[:, :2].T) > 1.5]
    cos, sin = math.cos(MOTION[2]), math.sin(MOTION[2])
    after = (points - [*MOTION[:2], 0.0]) @ np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    return [each / np.linalg.norm(each, axis=1, keepdims=True) for each in (points, after)]


def test_sightings_of_one_point_fit_the_motion(seen) -> None:
    assert fit_motion(*seen, MOTION, TOLERANCE).all()


def test_sightings_of_two_points_a_mirrored_world_and_a_motion_with_a_sign_exchanged_fit_few(seen) -> None:
    assert fit_motion(seen[0], np.roll(seen[1], 1, axis=0), MOTION, TOLERANCE).mean() < 0.02
    assert fit_motion(*(each * [1, -1, 1] for each in seen), MOTION, TOLERANCE).mean() < 0.05
    for exchanged in ([1, -1, 1], [1, 1, -1], [-1, -1, 1]):
        assert fit_motion(*seen, MOTION * exchanged, TOLERANCE).mean() < 0.05


def test_bearings_that_meet_behind_the_cameras_do_not_fit(seen) -> None:
    for sign in (-1.0, 1.0):
        assert not fit_motion(sign * seen[0], -seen[1], MOTION, TOLERANCE).any()


def test_a_bearing_off_the_plane_fits_within_the_tolerance() -> None:
    motion = np.array([1.0, 0.0, 0.0])
    for off, fits in [(0.3, True), (0.4, False)]:
        up = math.radians(off)
        raised = np.array([[0.0, math.cos(up), math.sin(up)]])
        assert fit_motion(raised, np.array([[-0.6, 0.8, 0.0]]), motion, TOLERANCE).tolist() == [fits]


def test_nothing_fits_without_a_motion_nor_bearings_that_are_not_numbers(seen) -> None:
    assert not fit_motion(*seen, np.zeros(3), TOLERANCE).any()
    assert not fit_motion(np.full((1, 3), np.nan), seen[1][:1], MOTION, TOLERANCE).any()
    assert fit_motion(np.empty((0, 3)), np.empty((0, 3)), MOTION, TOLERANCE).shape == (0,)
