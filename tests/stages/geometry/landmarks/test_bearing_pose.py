import math

import numpy as np
import pytest
from landmark_world import rotations

from omninav.stages.geometry.landmarks.bearing_pose import pose_of_bearings
from omninav.stages.geometry.plane.se2 import wrap

TOLERANCE, SIGMA = math.radians(0.6), math.radians(0.05)


def room(rng, number=120):
    """Points on the walls of a room of 6 x 4 m whose corner is the origin."""
    points = rng.uniform([0, 0, -0.8], [6, 4, 1.5], (number, 3))
    points[::4, 0], points[1::4, 0], points[2::4, 1], points[3::4, 1] = 0.0, 6.0, 0.0, 4.0
    return points


def bearings_of(points, pose, tilt=(0.0, 0.0), height=0.0, sigma=0.0, rng=None):
    """Unit vectors in the robot's frame."""
    rays = (points - [pose[0], pose[1], height]) @ rotations(np.array([pose]), np.array([tilt]))[0]
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    if rng is not None:
        rays += rng.normal(0.0, sigma, rays.shape)
    return rays / np.linalg.norm(rays, axis=1, keepdims=True)


@pytest.mark.parametrize("pose", [(1.5, 1.0, 0.0), (4.2, 3.1, 2.5), (5.0, 0.8, -1.8), (2.0, 2.0, math.pi)])
def test_the_pose_is_found_to_a_millimetre_among_wrong_matches(pose) -> None:
    rng = np.random.default_rng(0)
    points = room(rng)
    bearings = bearings_of(points, pose)
    wrong = np.arange(len(points)) % 3 == 0
    bearings[wrong] = np.roll(bearings[wrong], 7, axis=0)
    found = pose_of_bearings(bearings, points, TOLERANCE, SIGMA)
    assert np.hypot(*(found.pose - pose)[:2]) < 1e-3
    assert abs(wrap(found.pose[2] - pose[2])) < math.radians(0.02)
    assert found.inliers[~wrong].all()
    assert found.inliers[wrong].mean() < 0.1
    assert found.tilt < math.radians(0.05)


MIRRORED = [np.diag(each) for each in ([-1, 1, 1], [1, -1, 1], [1, 1, -1])]
SWAPPED = [np.eye(3)[each] for each in ([1, 0, 2], [2, 1, 0])]


@pytest.mark.parametrize("exchange", MIRRORED + SWAPPED)
def test_a_mirrored_world_and_one_with_swapped_axes_have_no_pose(exchange) -> None:
    points = np.random.default_rng(1).uniform([0, 0, -0.8], [6, 4, 1.5], (120, 3))  # a wall has a mirror image
    found = pose_of_bearings(bearings_of(points, (1.5, 1.0, 0.4)) @ exchange, points, TOLERANCE, SIGMA)
    assert found is None or found.inliers.sum() < 12


def test_no_robot_drives_upside_down() -> None:
    points = room(np.random.default_rng(1))
    points[:, 1] = 4.0  # one wall
    rolled = bearings_of(points, (1.5, 1.0, 0.4)) * [1, -1, -1]
    assert pose_of_bearings(rolled, points, TOLERANCE, SIGMA) is None


@pytest.mark.parametrize("tilt", [(3.0, 0.0), (0.0, -3.0), (2.0, 2.0)])
def test_a_robot_that_brakes_is_found_all_the_same(tilt) -> None:
    points, pose = room(np.random.default_rng(2)), (2.5, 1.7, 1.0)
    found = pose_of_bearings(bearings_of(points, pose, np.radians(tilt), 0.01), points, TOLERANCE, SIGMA)
    assert np.hypot(*(found.pose - pose)[:2]) < 1e-3
    assert found.pose[2] == pytest.approx(pose[2], abs=math.radians(0.1))
    assert math.degrees(found.tilt) == pytest.approx(math.hypot(*tilt), abs=0.1)


def test_the_covariance_is_that_of_the_errors() -> None:
    rng, squares, sigmas = np.random.default_rng(3), [], []
    for _ in range(200):
        points, pose = room(rng, 40), np.array([rng.uniform(1, 5), rng.uniform(1, 3), rng.uniform(-3, 3)])
        found = pose_of_bearings(bearings_of(points, pose, sigma=SIGMA, rng=rng), points, TOLERANCE, SIGMA)
        away = found.pose - pose
        away[2] = wrap(away[2])
        squares.append(away @ np.linalg.solve(SIGMA**2 * found.covariance, away))
        sigmas.append(found.sigma)
    assert 2.0 < np.mean(squares) < 4.5  # 3 freedoms
    assert np.median(sigmas) == pytest.approx(SIGMA, rel=0.3)


def test_bearings_at_random_agree_on_nothing() -> None:
    rng = np.random.default_rng(4)
    found = pose_of_bearings(bearings_of(room(rng), (3.0, 2.0, 0.0)), room(rng), TOLERANCE, SIGMA)
    assert found is None or found.inliers.sum() < 12


@pytest.mark.parametrize("number", [0, 3])
def test_fewer_than_four_points_say_nothing(number) -> None:
    points = room(np.random.default_rng(5), 8)[:number]
    assert pose_of_bearings(bearings_of(points, (3.0, 2.0, 0.0)), points, TOLERANCE, SIGMA) is None


@pytest.mark.parametrize("spread", [[0, 0, 0], [1, 0, 0]])
def test_points_in_one_place_or_in_a_row_do_not_break_it(spread) -> None:
    points = np.array([4.0, 1.0, 0.3]) + np.random.default_rng(6).uniform(-1, 1, (30, 1)) * spread
    found = pose_of_bearings(bearings_of(points, (1.0, 1.0, 0.0)), points, TOLERANCE, SIGMA)
    assert found is None or np.isfinite(found.pose).all()


def test_the_same_input_gives_the_same_pose() -> None:
    rng = np.random.default_rng(7)
    points = room(rng)
    bearings = bearings_of(points, (1.5, 1.0, 0.4), sigma=SIGMA, rng=rng)
    np.testing.assert_equal(*(pose_of_bearings(bearings, points, TOLERANCE, SIGMA) for _ in range(2)))
