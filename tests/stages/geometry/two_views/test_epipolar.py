"""Essential matrices over the full sphere; the convention is X1 = R X2 + t."""

import math

import numpy as np
import poselib
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from two_views import angle_deg, two_views, unit

from omninav.stages.geometry.two_views.epipolar import (
    angular_residuals,
    decompose,
    eight_points,
    essential,
    five_points,
    in_front,
    planar_candidates,
    shared_residuals,
    turn_about_vertical,
    yaw_of,
)
from omninav.stages.geometry.two_views.triangulation import depths, parallax, triangulate

SEEDS = st.integers(0, 10**6)
EITHER = st.booleans()


def relative_pose_of(matrix, first, second):
    """The pose of four with most points in front of both cameras."""
    poses = decompose(matrix)
    best = int(np.argmax(in_front(poses, first, second)))
    return poses[0][best], poses[1][best]


def closest(poses, rotation, translation):
    errors = [max(angle_deg(r, rotation), angle_deg(t, translation)) for r, t in zip(*poses, strict=True)]
    return min(errors, default=math.inf)


def test_a_point_ahead_of_a_robot_that_drove_to_its_left() -> None:
    # View 2 is taken 1 m to the left of view 1, turned by 90 degrees to the left: what was 2 m ahead and 1 m left is
    # then 2 m to its right. By hand: R (0, -2, 0) + (0, 1, 0) = (2, 1, 0).
    rotation, translation = turn_about_vertical(math.pi / 2), np.array([0.0, 1.0, 0.0])
    assert rotation @ (0.0, -2.0, 0.0) + translation == pytest.approx([2.0, 1.0, 0.0])
    first, second = unit(np.array([[2.0, 1.0, 0.0]])), np.array([[0.0, -1.0, 0.0]])
    assert triangulate(first, second, rotation, translation)[0] == pytest.approx([2.0, 1.0, 0.0])
    rolled = turn_about_vertical(0.8) @ Rotation.from_euler("x", 0.6).as_matrix()
    assert yaw_of(rolled) == pytest.approx(0.8)  # whatever the roll


@given(SEEDS, EITHER)
def test_bearings_of_one_point_lie_in_a_plane_with_the_baseline(seed: int, planar: bool) -> None:
    rotation, translation, first, second = two_views(seed, 20, planar=planar)
    matrix = essential(rotation, translation)
    assert np.einsum("ni,ij,nj->n", first, matrix, second) == pytest.approx(np.zeros(20), abs=1e-12)
    assert angular_residuals(matrix, first, second) == pytest.approx(np.zeros(20), abs=1e-7)
    assert shared_residuals(rotation, translation, first, second) == pytest.approx(np.zeros(20), abs=1e-7)


@given(SEEDS, st.floats(-1.5, 1.5))
def test_the_residual_is_the_angle_to_the_epipolar_plane(seed: int, lifted: float) -> None:
    rotation, translation, first, second = two_views(seed, 20, planar=False)
    normals = unit(second @ essential(rotation, translation).T)
    moved = math.cos(lifted) * first + math.sin(lifted) * normals  # first lies in its plane
    residuals = angular_residuals(essential(rotation, translation), moved, second)
    assert residuals == pytest.approx(np.full(20, abs(lifted)), abs=1e-9)


def test_a_bearing_along_the_baseline_fits_every_plane() -> None:
    rotation, translation = np.eye(3), np.array([1.0, 0.0, 0.0])
    assert angular_residuals(essential(rotation, translation), [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])[0] == 0.0
    assert shared_residuals(rotation, translation, [[1.0, 0.0, 0.0]], [[1.0, 0.0, 0.0]])[0] == 0.0


@given(SEEDS)
def test_the_shared_residual_has_the_size_of_the_noise(seed: int) -> None:
    rotation, translation, first, second = two_views(seed, 2000, noise_deg=0.1, planar=False)
    spread = np.degrees(np.sqrt(np.mean(shared_residuals(rotation, translation, first, second) ** 2)))
    assert spread == pytest.approx(0.1, rel=0.1)


@given(SEEDS, st.sampled_from([8, 12]), EITHER)
def test_eight_points_give_the_essential_matrix_and_a_quality_of_0(seed: int, number: int, planar: bool) -> None:
    rotation, translation, first, second = two_views(seed, number, planar=planar)
    matrix, quality = eight_points(first, second)
    truth = essential(rotation, translation)
    assert abs(float((matrix * truth).sum())) == pytest.approx(2.0, abs=1e-6)  # equal but for the sign
    assert quality == pytest.approx(0.0, abs=1e-5)
    assert np.linalg.svd(matrix)[1] == pytest.approx([1.0, 1.0, 0.0], abs=1e-9)


def test_the_quality_is_1_minus_the_ratio_of_singular_values() -> None:
    # Bearings for which another matrix than an essential one fits: b1' diag(1, 0.5, 0) b2 = 0.
    rng = np.random.default_rng(0)
    second = unit(rng.normal(size=(30, 3)))
    first = unit(np.cross(second @ np.diag([1.0, 0.5, 0.0]), rng.normal(size=(30, 3))))
    assert eight_points(first, second)[1] == pytest.approx(0.5)  # 1 - 0.5/1 (erratum 36)


@given(SEEDS)
def test_many_linear_fits_at_once_are_those_of_one_at_a_time(seed: int) -> None:
    pairs = [two_views(seed + k, 8, noise_deg=0.1)[2:] for k in range(3)]
    matrices, qualities = eight_points(np.stack([p[0] for p in pairs]), np.stack([p[1] for p in pairs]))
    for (first, second), matrix, quality in zip(pairs, matrices, qualities, strict=True):
        alone, its = eight_points(first, second)
        assert matrix == pytest.approx(alone)
        assert quality == pytest.approx(its)
    rotations, translations = decompose(matrices)
    assert rotations[1] == pytest.approx(decompose(matrices[1])[0])
    assert translations[2] == pytest.approx(decompose(matrices[2])[1])


@pytest.mark.parametrize("planar", [True, False])
def test_a_solution_of_five_points_is_the_true_pose(planar: bool) -> None:
    """But for one sample in a thousand, next to a double root, where the solver finds nothing close."""
    found = 0
    for seed in range(400):
        rotation, translation, first, second = two_views(seed, 5, planar=planar)
        found += closest(five_points(first, second), rotation, translation) < 0.1
    assert found >= 397


@given(SEEDS)
def test_a_solution_of_two_points_is_the_true_pose_of_a_robot_on_a_floor(seed: int) -> None:
    rotation, translation, first, second = two_views(seed, 2)
    rotations, translations, _ = planar_candidates(first, second, np.array([[0, 1]]))
    assert len(rotations) == 2
    assert closest((np.tile(rotations, (2, 1, 1)), np.vstack([translations, -translations])), rotation, translation) < (
        1e-3 if min(np.abs(first[:, 2]).min(), np.abs(second[:, 2]).min()) > 0.02 else 0.5
    )


@settings(max_examples=30)
@given(SEEDS)
def test_both_solutions_of_two_points_are_among_those_of_poselib(seed: int) -> None:
    _, _, first, second = two_views(seed, 2)
    upright = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])  # our z is its y
    theirs = poselib.relpose_upright_planar_2pt(second @ upright.T, first @ upright.T)
    ours = planar_candidates(first, second, np.array([[0, 1]]))
    for pose in theirs:
        turned = upright.T @ pose.R @ upright, upright.T @ pose.t
        best = closest((np.tile(ours[0], (2, 1, 1)), np.vstack([ours[1], -ours[1]])), turned[0], unit(turned[1]))
        assert best < 1e-3


def test_points_on_the_horizon_say_nothing_to_a_robot_on_a_floor() -> None:
    level = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    first, second = (np.vstack([level, others]) for others in two_views(0, 2)[2:])
    assert planar_candidates(first, second, np.array([[0, 1], [2, 3]]))[2].tolist() == [1, 1]


@given(SEEDS, EITHER)
def test_of_four_poses_the_right_one_has_all_points_in_front(seed: int, planar: bool) -> None:
    rotation, translation, first, second = two_views(seed, 10, planar=planar)
    poses = decompose(essential(rotation, translation))
    assert all(np.linalg.det(r) == pytest.approx(1.0) for r in poses[0])
    counts = in_front(poses, first, second)
    assert sorted(counts)[-1] == 10
    found = relative_pose_of(essential(rotation, translation), first, second)
    assert angle_deg(found[0], rotation) < 1e-4
    assert angle_deg(found[1], translation) < 1e-4


def test_points_below_or_behind_a_camera_are_in_front_by_depth_where_z_says_they_are_not() -> None:
    """The first trap (erratum 36): half of what an omnidirectional camera sees has a negative z."""
    rotation, translation = turn_about_vertical(0.3), np.array([0.6, 0.8, 0.0])
    points = np.random.default_rng(1).uniform([-4, -4, -2], [4, 4, -0.5], (40, 3))  # all below
    first, second = unit(points), unit((points - translation) @ rotation)
    here, there = depths(first, second, rotation, translation)
    assert here == pytest.approx(np.linalg.norm(points, axis=1))
    assert there == pytest.approx(np.linalg.norm(points - translation, axis=1))
    assert angle_deg(relative_pose_of(essential(rotation, translation), first, second)[1], translation) < 1e-4


@given(SEEDS, EITHER)
def test_who_is_camera_1_decides_on_the_sign(seed: int, planar: bool) -> None:
    """The second trap (erratum 39): exchanged views give -R' t, the way back, and not t."""
    rotation, translation, first, second = two_views(seed, 12, planar=planar)
    forth = relative_pose_of(eight_points(first, second)[0], first, second)
    back = relative_pose_of(eight_points(second, first)[0], second, first)
    assert angle_deg(forth[1], translation) < 0.01
    assert angle_deg(back[1], -rotation.T @ translation) < 0.01
    assert angle_deg(back[0], rotation.T) < 0.01


@given(SEEDS, EITHER)
def test_points_are_triangulated_where_they_are(seed: int, planar: bool) -> None:
    rng = np.random.default_rng(seed)
    rotation, translation, _, _ = two_views(seed, 1, planar=planar)
    points = unit(rng.normal(size=(30, 3))) * rng.uniform(1.5, 6.0, (30, 1))
    first, second = unit(points), unit((points - translation) @ rotation)
    wide = parallax(first, second, rotation) > 0.01
    found = triangulate(first, second, rotation, translation)
    assert found[wide] == pytest.approx(points[wide], abs=1e-6)
    middle = Rotation.from_matrix(rotation)  # the angle at the point, by the two ways to it
    angles = np.arccos(np.clip(np.einsum("ij,ij->i", first, middle.apply(second)), -1, 1))
    assert parallax(first, second, rotation) == pytest.approx(angles, abs=1e-6)


def test_lines_that_meet_behind_or_nowhere_are_no_points() -> None:
    # Along (1, 1) and, from (-1, 0), along (1, 2) they meet in (-2, -2), along (0, 1) and against (1, 1) in (0, 1).
    rotation, way = np.eye(3), np.array([-1.0, 0.0, 0.0])
    first = unit(np.array([[1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]))
    second = unit(np.array([[1.0, 2.0, 0.0], [-1.0, -1.0, 0.0], [0.0, 0.0, 1.0]]))
    assert np.isnan(triangulate(first, second, rotation, way)).all()
    here, there = depths(first, second, rotation, way)
    assert here == pytest.approx([-math.sqrt(8.0), 1.0, math.inf])
    assert there == pytest.approx([-math.sqrt(5.0), -math.sqrt(2.0), math.inf])
    assert in_front((rotation[None], way[None]), first, second).tolist() == [1]
