"""Camera poses from points of which many are wrong, over the full sphere; the refinement against poselib's."""

import math

import numpy as np
import poselib
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from two_views import angle_deg, unit

from omninav.stages.geometry.two_views.absolute_pose import refined_camera, sees, three_point_pose

SEEDS = st.integers(0, 10**6)


def scene(seed: int, number: int, planar: bool = False) -> tuple[np.ndarray, ...]:
    rng = np.random.default_rng(seed)
    rotation = (Rotation.from_euler("z", rng.uniform(-3, 3)) if planar else Rotation.random(rng=rng)).as_matrix()
    translation = rng.normal(size=3) * (1.0, 1.0, 0.0 if planar else 1.0)
    points = rng.normal(size=(number, 3)) * 3.0
    return rotation, translation, points, unit((points - translation) @ rotation)


def noisy(bearings: np.ndarray, points: np.ndarray, wrong: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    bearings = unit(bearings + math.radians(0.1) * rng.normal(size=bearings.shape))
    bearings[:wrong] = unit(rng.normal(size=(wrong, 3)))
    return bearings


@settings(max_examples=20)
@given(SEEDS, st.booleans())
def test_the_camera_is_found_among_as_many_wrong_points(seed: int, planar: bool) -> None:
    rotation, translation, points, bearings = scene(seed, 100, planar)
    found = three_point_pose(noisy(bearings, points, 50, seed), points, np.random.default_rng(seed), planar=planar)
    assert found is not None
    assert angle_deg(found.rotation, rotation) < 0.2
    assert np.linalg.norm(found.translation - translation) < 0.03
    assert found.inliers[50:].mean() > 0.9
    if planar:
        assert found.translation[2] == 0.0
        assert found.rotation[2, 2] == 1.0


def test_refined_it_is_as_good_as_poselibs() -> None:
    ours, theirs = [], []
    for seed in range(20):
        rotation, translation, points, bearings = scene(seed, 60)
        ahead = bearings[:, 2] > 0.3  # its refinement wants a pinhole camera
        points, seen = points[ahead], noisy(bearings[ahead], points[ahead], 0, seed)
        found = refined_camera(rotation, translation, seen, points, math.radians(5.0))
        start = poselib.CameraPose()
        start.R, start.t = rotation.T, -rotation.T @ translation
        camera = {"model": "PINHOLE", "width": 2, "height": 2, "params": [1.0, 1.0, 0.0, 0.0]}
        other, _ = poselib.refine_absolute_pose(
            seen[:, :2] / seen[:, 2:], points, start, camera, {"loss_type": "TRIVIAL"}
        )
        ours.append(np.linalg.norm(found[1] - translation))
        theirs.append(np.linalg.norm(-other.R.T @ other.t - translation))
    assert np.median(ours) <= 1.1 * np.median(theirs)


def test_the_same_seed_gives_the_same_pose() -> None:
    _, _, points, bearings = scene(1, 60)
    seen = noisy(bearings, points, 30, 1)
    one, two = (vars(three_point_pose(seen, points, np.random.default_rng(3))) for _ in range(2))
    np.testing.assert_equal(one, two)
    assert one["samples"] == 96  # half are right: log(1e-4) / log(1 - 1/8) = 69, of 32 at once


def test_three_points_are_enough_and_two_or_points_that_coincide_are_not() -> None:
    _, _, points, bearings = scene(1, 3)
    found = three_point_pose(bearings, points, np.random.default_rng(0))
    assert found is not None
    assert found.inliers.all()
    twice = np.array([[1.0, 0, 0], [1.0, 0, 0], [0, 1.0, 0]])
    for seen, given_points in (
        (bearings[:2], points[:2]),
        (unit(np.ones((5, 3))), np.ones((5, 3))),
        (np.eye(3), twice),
    ):
        assert three_point_pose(seen, given_points, np.random.default_rng(0)) is None


def test_what_is_seen_is_told_by_the_angle() -> None:
    # From (1, 0, 0), looking along y, the point is straight ahead.
    off = np.radians([0.99, -1.01, 180.0])
    bearings, points = np.column_stack([np.cos(off), np.sin(off), 0.0 * off]), np.tile([1.0, 2.0, 0.0], (3, 1))
    rotation, translation = Rotation.from_euler("z", math.pi / 2).as_matrix(), np.array([1.0, 0.0, 0.0])
    assert sees(rotation, translation, bearings, points, math.radians(1.0)).tolist() == [True, False, False]


@pytest.mark.parametrize(("seed", "planar"), [(seed, planar) for seed in range(10) for planar in (False, True)])
def test_refinement_leads_back_to_the_exact_pose_from_two_degrees_and_centimetres_off(seed: int, planar: bool) -> None:
    rotation, translation, points, bearings = scene(seed, 60, planar)
    free = np.array([0.0, 0.0, 1.0] if planar else [0.6, 0.0, 0.8])
    off = Rotation.from_rotvec(math.radians(2.0) * free).as_matrix() @ rotation
    away = translation + 0.02 * np.array([1.0, -1.0, 0.0 if planar else 1.0])
    found = refined_camera(off, away, bearings, points, math.radians(10.0), planar)
    assert found[0] == pytest.approx(rotation, abs=1e-9)
    assert found[1] == pytest.approx(translation, abs=1e-9)
