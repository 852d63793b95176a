import numpy as np
import pytest
from landmark_world import displaced, driven, misplaced, seen_in

from omninav.stages.geometry.landmarks.map_adjustment import (
    AdjustedMap,
    adjusted_drive,
    adjusted_to_given,
    found_with_mount,
)
from omninav.stages.geometry.landmarks.map_making import LocalViews, neighbouring_pairs, pair_matches
from omninav.stages.geometry.plane.image_delay import RobotPath
from omninav.stages.geometry.plane.mount import camera_poses
from omninav.stages.geometry.plane.se2 import chain, wrap


@pytest.fixture
def to_given(views, similarity):
    """Adjusts given poses, by default to what the drive's images show."""

    def run(poses, views=views):
        matches = pair_matches(views, neighbouring_pairs(poses, iter(similarity), 0.5))
        return adjusted_to_given(views, matches, poses, seen_in(views))

    return run


def test_exact_poses_stay_exact(world, to_given):
    found = to_given(world.poses)
    assert not found.problem
    assert misplaced(found.poses, world.poses)[0] < 0.002


def test_poses_that_are_wrong_by_10_cm_and_2_degrees_are_mended(world, to_given):
    wrong = displaced(world.poses, np.random.default_rng(2))
    found = to_given(wrong)
    assert misplaced(wrong, world.poses)[0] > 0.12
    assert misplaced(found.poses, world.poses)[0] < 0.03
    assert np.abs((found.poses - wrong)[:, :2].mean(axis=0)).max() < 0.005  # the frame is that of all poses


def test_a_single_wrong_pose_among_exact_ones_is_mended_and_the_others_stay(world, to_given):
    wrong = world.poses.copy()
    wrong[40] += [0.3, -0.2, 0.1]
    found = to_given(wrong)
    assert np.abs(found.poses - world.poses)[40] == pytest.approx(0.0, abs=0.01)
    assert misplaced(found.poses, world.poses)[0] < 0.003


def test_exact_poses_stay_where_images_are_too_vague_to_fit_others_better(world, views, to_given):
    rng = np.random.default_rng(5)
    vague = views.bearings + np.radians(0.35) * rng.standard_normal(views.bearings.shape)
    vague /= np.linalg.norm(vague, axis=1, keepdims=True)
    found = to_given(world.poses, views.looking_along(vague))
    assert not found.problem
    assert (found.poses == world.poses).all(axis=1).mean() > 0.95


def test_a_drive_by_odometry_is_straightened_and_its_first_pose_stays(world, views, similarity):
    _, odometry = driven(world.poses)
    found = adjusted_drive(views, iter(similarity), odometry, seen_in(views), None, np.random.default_rng(3))
    assert misplaced(odometry, world.poses)[0] > 0.4
    assert misplaced(found.poses, world.poses)[0] < 0.05
    assert found.poses[0] == pytest.approx(odometry[0])
    assert found.closures > 10
    assert found.scale is None


def test_motion_seen_in_images_is_straightened_in_a_unit_of_its_own(world, views, similarity):
    _, odometry = driven(world.poses)
    odometry[:, :2] *= 1.7
    found = adjusted_drive(views, iter(similarity), odometry, seen_in(views), None, np.random.default_rng(3), True)
    error, factor = misplaced(found.poses, world.poses)
    assert error < 0.02
    assert factor == pytest.approx(1.0 / 1.7, rel=0.05)


def test_a_drive_that_comes_back_to_no_place_stays_as_it_is(world, views, similarity):
    some = slice(0, 5)
    few = LocalViews(views.starts[:6], views.bearings[: views.starts[5]], views.descriptors[: views.starts[5]])
    similarity = iter(similarity[some, some])
    found = adjusted_drive(few, similarity, world.poses[some], seen_in(few), None, np.random.default_rng(0))
    assert "came back to" in found.problem
    assert (found.poses == world.poses[some]).all()


def test_images_of_a_mirrored_camera_leave_the_poses(world, views, to_given):
    mirrored = views.looking_along(views.bearings * [1.0, -1.0, 1.0])
    found = to_given(world.poses, mirrored)
    assert "contradicts the poses" in found.problem
    assert (found.poses == world.poses).all()


@pytest.mark.parametrize("number", [0, 1, 3])
def test_images_without_features_leave_the_poses(number):
    poses = np.random.default_rng(0).normal(size=(number, 3))
    nothing = LocalViews(np.zeros(number + 1, np.int64), np.empty((0, 3)), np.empty((0, 32), np.uint8))
    alike = [np.zeros(number, np.float32)] * number
    matches = pair_matches(nothing, neighbouring_pairs(poses, alike, 0.5))
    assert adjusted_to_given(nothing, matches, poses, seen_in(nothing)).problem
    assert adjusted_drive(nothing, alike, poses, seen_in(nothing), None, np.random.default_rng(0)).problem


def half_seen(mount: np.ndarray, problem: str = ""):
    """An adjustment that brings the poses of a camera with a `mount` 0.7 of the way to where they are."""
    robot = turning_drive()

    def adjust(poses: np.ndarray) -> AdjustedMap:
        missing = camera_poses(robot, mount) - poses
        missing[:, 2] = wrap(missing[:, 2])
        return AdjustedMap(poses, np.empty(0), problem, seen=poses + 0.7 * missing)

    return robot, adjust


def turning_drive() -> np.ndarray:
    turns = 0.3 * np.random.default_rng(0).normal(size=100)
    return chain(np.column_stack([np.full(100, 0.4), np.zeros(100), turns]))


def test_a_mount_is_found_round_by_round_until_little_is_left():
    mount = np.array([0.4, -0.1, 0.0])
    robot, adjust = half_seen(mount)
    found, as_found, delay = found_with_mount(RobotPath(robot), np.zeros(3), adjust, adjust)
    assert delay == 0.0
    assert as_found == pytest.approx(mount, abs=0.0015)
    assert found.poses == pytest.approx(camera_poses(robot, as_found))


def test_a_mount_with_which_nothing_fits_either_is_not_believed():
    robot, adjust = half_seen(np.array([0.4, 0.0, 0.0]), problem="too few landmarks are seen")
    described = np.array([0.1, 0.0, 0.0])
    found, mount, _ = found_with_mount(RobotPath(robot), described, adjust, half_seen(np.array([0.4, 0.0, 0.0]))[1])
    assert found.problem
    assert (mount == described).all()
