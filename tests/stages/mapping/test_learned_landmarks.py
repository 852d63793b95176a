from dataclasses import replace

import numpy as np
import pytest
from landmark_tour import HEIGHT_M, graph_of, mapped_room, room, seen_from, tour_poses, with_landmarks
from made_words import NOTHING
from scipy.spatial import KDTree

from omninav.stages.values.landmarks import DESCRIPTOR_SCALE


def test_points_of_the_room_are_found_to_a_millimetre_and_known_by_their_looks() -> None:
    landmarks = mapped_room().landmarks
    where = room().where - (0.0, 0.0, HEIGHT_M)
    looks = np.sqrt(room().looks / room().looks.sum(axis=1, keepdims=True))
    gap, nearest = KDTree(where).query(landmarks.points)
    assert len(landmarks) > 400
    assert gap.max() < 1e-3
    assert landmarks.descriptors / DESCRIPTOR_SCALE == pytest.approx(looks[nearest], abs=1.1 / DESCRIPTOR_SCALE)


def test_references_see_the_landmarks_around_them() -> None:
    map = mapped_room()
    landmarks = map.landmarks
    assert landmarks.references == len(landmarks.words) == len(map)
    for reference, pose in enumerate(map.poses):
        own = landmarks.seen_by(np.array([reference]))
        assert len(own) > 50
        assert np.hypot(*(landmarks.points[own, :2] - pose[:2]).T).max() < 3.01
    assert (np.bincount(landmarks.seen, minlength=len(landmarks)) >= 2).all()


def test_only_images_that_became_references_are_used() -> None:
    poses, taken = tour_poses(0.2), [n % 2 == 0 for n in range(len(tour_poses(0.2)))]
    features = [seen_from(room(), pose) for pose in poses]
    some = with_landmarks(graph_of(poses[::2]), features, taken)
    alone = with_landmarks(graph_of(poses[::2]), features[::2])
    assert some.landmarks.references == len(poses[::2])
    assert some.landmarks.points.tobytes() == alone.landmarks.points.tobytes()
    assert some.landmarks.descriptors.tobytes() == alone.landmarks.descriptors.tobytes()


def test_next_to_nothing_agrees_in_the_images_of_a_mirrored_camera() -> None:
    poses = tour_poses()
    features = [seen_from(room(), pose) for pose in poses]
    mirrored = [replace(each, bearings=each.bearings * [1.0, -1.0, 1.0]) for each in features]
    found = with_landmarks(graph_of(poses), mirrored).landmarks
    assert len(found.seen) < 0.1 * len(mapped_room().landmarks.seen)


def test_images_without_features_give_a_map_without_landmarks() -> None:
    landmarks = with_landmarks(graph_of(tour_poses()[:3]), [NOTHING, None, NOTHING]).landmarks
    assert (len(landmarks), landmarks.references) == (0, 3)
    assert landmarks.seen_by(np.array([0, 1, 2])).shape == (0,)


def test_a_black_image_among_others_sees_nothing() -> None:
    poses = tour_poses()
    features = [seen_from(room(), pose) for pose in poses]
    features[3] = NOTHING
    landmarks = with_landmarks(graph_of(poses), features).landmarks
    assert len(landmarks.seen_by(np.array([3]))) == 0
    assert len(landmarks) > 300


def test_one_reference_or_none_sees_no_landmark() -> None:
    for number in (0, 1):
        poses = tour_poses()[:number]
        landmarks = with_landmarks(graph_of(poses), [seen_from(room(), pose) for pose in poses]).landmarks
        assert (len(landmarks), landmarks.references) == (0, number)
