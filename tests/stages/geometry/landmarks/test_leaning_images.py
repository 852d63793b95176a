"""Images of a tour that lean each by themselves, by landmarks of a room that they share."""

import math

import numpy as np
import pytest
from landmark_tour import room, seen_from, tour_poses
from made_tour import Landmarks as Points

from omninav.stages.geometry.landmarks.adjustment import rotations_about
from omninav.stages.geometry.landmarks.leaning_images import Levelling, leaning_images, levelled
from omninav.stages.geometry.landmarks.map_adjustment import odometry_motions
from omninav.stages.geometry.landmarks.map_making import LocalViews, local_views, neighbouring_pairs, pair_matches
from omninav.stages.geometry.plane.se2 import between, chain, compose

POSES = tour_poses(0.3)


def leaning(
    tilts: np.ndarray, few: int | None = None, heights: np.ndarray | None = None
) -> tuple[LocalViews, np.ndarray]:
    """The views of cameras with roll and pitch (R, 2), rad, and the rotations (R, 3, 3) that level them.

    The reference `few` sees ten points alone. `heights` (R,): by which each camera is too high, m.
    """
    heights = np.zeros(len(POSES)) if heights is None else heights
    rooms = [Points(room().where - [0.0, 0.0, height]) for height in heights]
    features = [seen_from(points, pose) for points, pose in zip(rooms, POSES, strict=True)]
    if few is not None:
        features[few] = features[few].chosen(np.arange(10))
    turns = rotations_about(tilts[:, 1], 1) @ rotations_about(tilts[:, 0], 0)
    bearings = [each.bearings @ turn for each, turn in zip(features, turns, strict=True)]
    return local_views(bearings, [each.descriptors for each in features]), turns


def found(
    views: LocalViews, poses: np.ndarray = POSES, are_given: bool = True, leave_shared: bool = False
) -> Levelling | None:
    similarity = np.exp(-np.hypot(*(POSES[:, None] - POSES)[:, :, :2].transpose(2, 0, 1)))
    matches = pair_matches(views, neighbouring_pairs(poses, iter(similarity), 0.5))
    motions = None if are_given else odometry_motions(poses, seen_motion=False)
    return leaning_images(views, matches, poses, motions, leave_shared)


def carried(sigma_deg: float, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(0.0, math.radians(sigma_deg), (len(POSES), 2))


def off(views: LocalViews, levelling: Levelling, turns: np.ndarray) -> float:
    """The largest angle (rad) between what is made of the vertical and what rotations (R, 3, 3) make of it."""
    one, other = levelling.rotations, turns[views.owners]
    return float(np.linalg.norm((one - other)[:, :, 2], axis=1).max())


@pytest.mark.parametrize("sigma_deg", [1.0, 6.0])
def test_the_tilt_of_each_image_is_found_although_poses_are_off(sigma_deg: float) -> None:
    views, turns = leaning(carried(sigma_deg))
    wrong = POSES + np.random.default_rng(1).normal(size=POSES.shape) * [0.03, 0.03, math.radians(0.5)]
    levelling = found(views, wrong)
    assert off(views, levelling, turns) < math.radians(0.25)
    assert levelling.leaning_deg == pytest.approx(1.18 * sigma_deg, rel=0.3)
    level = levelled(views, levelling)
    exact = np.concatenate([seen_from(room(), pose).bearings for pose in POSES])
    before, after = (np.median(np.abs(each.bearings - exact)) for each in (views, level))
    assert after < 0.25 * before


def test_the_tilt_of_each_image_is_found_on_a_tour_by_odometry() -> None:
    motions = between(POSES[:-1], POSES[1:])
    motions[:, 2] += 0.003
    odometry = compose(POSES[0], np.concatenate([np.zeros((1, 3)), chain(motions)]))
    assert np.hypot(*(odometry - POSES)[:, :2].T).max() > 0.5
    views, turns = leaning(carried(3.0))
    assert off(views, found(views, odometry, are_given=False), turns) < math.radians(0.3)


@pytest.mark.parametrize("sigma_deg", [0.0, 3.0])
def test_images_from_other_heights_are_brought_to_one(sigma_deg: float) -> None:
    heights = np.random.default_rng(2).normal(0.0, 0.02, len(POSES))
    views, _ = leaning(carried(sigma_deg), heights=heights - heights.mean())
    exact = np.concatenate([seen_from(room(), pose).bearings for pose in POSES])
    level = levelled(views, found(views))
    before, after = (np.median(np.linalg.norm(each.bearings - exact, axis=1)) for each in (views, level))
    assert after < (0.15 if sigma_deg else 0.35) * before


def test_the_tilt_that_all_images_share_may_be_left_in() -> None:
    shared = np.radians([2.0, -3.0])
    views, _ = leaning(carried(3.0) + shared)
    mean = np.median(carried(3.0) + shared, axis=0)
    whole, left = (found(views, leave_shared=leave).rotations for leave in (False, True))
    assert np.median(left[:, 2, :2], axis=0) == pytest.approx([0.0, 0.0], abs=math.radians(0.2))
    assert np.median(whole[:, 2, :2], axis=0) == pytest.approx([-mean[1], mean[0]], abs=math.radians(0.2))


def test_level_images_a_camera_that_leans_on_its_robot_and_images_without_matches_are_left_as_they_are() -> None:
    for tilts in (carried(0.0), carried(0.1), np.tile(np.radians([2.0, -3.0]), (len(POSES), 1))):
        assert found(leaning(tilts)[0]) is None
    nothing = local_views([np.empty((0, 3))] * len(POSES), [np.empty((0, 128), np.uint8)] * len(POSES))
    assert found(nothing) is None


def test_a_reference_that_sees_too_little_is_left_as_it_is() -> None:
    views, turns = leaning(carried(3.0), few=7)
    levelling = found(views)
    assert (levelling.rotations[views.rows(7)] == np.eye(3)).all()
    assert not levelling.raised[views.rows(7)].any()
    turns[7] = np.eye(3)
    assert off(views, levelling, turns) < math.radians(0.15)
