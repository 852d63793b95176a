"""Maps without a common frame, aligned by the landmarks that are in several of them."""

from dataclasses import replace

import numpy as np
import pytest
from landmark_tour import graph_of, mapped_room, room, seen_from, tour_poses, with_landmarks

from omninav.pipeline import Context
from omninav.stages.geometry.plane.se2 import between, wrap
from omninav.stages.map_files.aligned_by_landmarks import aligned_by_landmarks
from omninav.stages.map_files.references import joined_references
from omninav.stages.sensor.landmark_pose import LandmarkPose, LandmarkPoseState

FRAME = np.array([4.0, -7.0, 2.5])


def mapped(poses, points=None):
    """A map of some poses in the room, in a frame of its own."""
    map = with_landmarks(graph_of(poses), [seen_from(points or room(), pose) for pose in poses])
    return replace(map.moved(between(FRAME, map.poses)), pose_source="odometry")


def test_maps_are_put_where_their_common_landmarks_are_in_whatever_order_they_come() -> None:
    there, back = np.split(tour_poses(0.45), 2)
    back[:, 1] += 0.3
    maps = [mapped_room(), mapped(there), mapped(back)]
    found = aligned_by_landmarks(maps, np.random.default_rng(0))
    away = found.poses - np.concatenate([mapped_room().poses, there, back])
    assert found.joined == (True, True, True)
    assert np.abs(away[:, :2]).max() < 0.005
    assert np.abs(wrap(away[:, 2])).max() < np.radians(0.1)


def test_a_mirrors_map_is_aligned_with_a_panoramas() -> None:
    map = mapped_room()
    reflected = replace(map, landmarks=map.landmarks.as_mirrored(True))
    assert aligned_by_landmarks([map, reflected], np.random.default_rng(0)).closures == len(map.landmarks)


def test_all_landmarks_of_a_map_agree_with_itself() -> None:
    found = aligned_by_landmarks([mapped_room()] * 3, np.random.default_rng(0))
    assert found.closures == 2 * len(mapped_room().landmarks)


def test_a_map_of_another_room_or_without_landmarks_is_aligned_with_nothing() -> None:
    other = mapped(tour_poses(0.45), room(seed=5))
    assert aligned_by_landmarks([mapped_room(), other], np.random.default_rng(0)) is None
    assert aligned_by_landmarks([mapped_room(), replace(other, landmarks=None)], np.random.default_rng(0)) is None


def test_in_a_joined_map_whose_landmarks_are_there_twice_an_image_is_found_as_in_one() -> None:
    twice = joined_references([mapped_room(), mapped_room()], "truth")
    pose = np.array([5.1, 3.1, 0.4])
    for map in (mapped_room(), twice):
        fix = LandmarkPose().step(Context("landmark_pose"), LandmarkPoseState(), seen_from(room(), pose), map).fix
        assert fix.inliers[0] > 100
        assert fix.poses[0] == pytest.approx(pose, abs=2e-3)
