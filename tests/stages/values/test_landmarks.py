from dataclasses import replace

import numpy as np
import pytest
from landmark_tour import FEW, mapped_room

from omninav.pipeline.graph.contents import violation
from omninav.stages.geometry.plane.se2 import compose
from omninav.stages.values.landmarks import LandmarkFix, Landmarks, restored_descriptors, stored_descriptors


def seen_by(landmarks: Landmarks, row: int) -> np.ndarray:
    """Rows of the landmarks that a reference sees."""
    return landmarks.seen[landmarks.starts[row] : landmarks.starts[row + 1]]


def test_some_references_keep_what_they_see_in_their_order() -> None:
    map = mapped_room()
    rows = np.array([30, 4, 17])
    some = map.landmarks.of_references(rows)
    assert some.references == len(some.words) == 3
    for number, row in enumerate(rows):
        own, before = seen_by(some, number), seen_by(map.landmarks, row)
        assert (some.points[own] == map.landmarks.points[before]).all()
        assert (some.descriptors[own] == map.landmarks.descriptors[before]).all()
    assert len(some) == len(np.unique(some.seen)) < len(map.landmarks)
    whole = map.landmarks.words
    weights = [whole.weights[whole.starts[row] : whole.starts[row + 1]] for row in rows]
    assert some.words.weights.tolist() == np.concatenate(weights).tolist()
    cut = replace(map, poses=map.poses[rows], features=map.features[rows], edges=FEW, landmarks=some)
    assert violation(cut) is None


def test_points_that_some_references_see_are_named_once() -> None:
    landmarks = mapped_room().landmarks
    seen = {*seen_by(landmarks, 4).tolist(), *seen_by(landmarks, 5).tolist()}
    assert landmarks.seen_by(np.array([5, 4])).tolist() == sorted(seen)
    values = np.array([[0.0, 0.25, 1.0]], np.float32)
    assert stored_descriptors(values).tolist() == [[0, 128, 255]]
    assert restored_descriptors(stored_descriptors(values)).tolist() == [[0.0, 0.25, 255 / 512]]


def test_a_camera_described_as_the_tours_sits_and_lags_as_the_tours_did() -> None:
    tours, shown = np.array([0.1, 0.2, 0.3]), np.array([0.15, 0.26, 0.37])
    landmarks = replace(mapped_room().landmarks, described=tours, mount=shown, described_delay_s=0.1, delay_s=0.15)
    beside, turned = np.array([0.5, 0.2, 0.3]), np.array([0.1, 0.2, 0.4])
    for described, placed, pose in [
        (tours, True, [0.15, 0.26, 0.07]),
        (tours, False, [0.15, 0.26, 0.07]),
        (beside, True, [0.5, 0.2, 0.0]),
        (beside, False, [0.15, 0.26, 0.07]),
        (turned, True, [0.1, 0.2, 0.0]),
        (turned, False, [0.15, 0.26, 0.0]),
    ]:
        assert landmarks.mounted(described, placed) == pytest.approx(pose)
    assert [landmarks.late_by(stated) for stated in (None, 0.1, 0.2)] == pytest.approx([0.15, 0.05, 0.0])


def test_poses_that_are_ruled_out_leave_the_others_more_probable() -> None:
    fix = LandmarkFix(
        np.arange(9.0).reshape(3, 3),
        np.eye(3) * np.array([1.0, 2.0, 3.0])[:, None, None],
        np.array([30, 20, 10]),
        np.array([0.5, 0.2, 0.1]),
        90,
        agree=np.array([0, 1, 2, -1, 2], np.int8),
    )
    left = fix.without(np.array([False, True, False]))
    assert violation(fix) is violation(left) is None
    assert len(left) == 2
    assert (left.poses[:, 0].tolist(), left.inliers.tolist()) == ([0.0, 6.0], [30, 10])
    assert left.covariances[:, 0, 0].tolist() == [1.0, 3.0]
    assert left.probabilities == pytest.approx([0.625, 0.125])
    assert left.agree.tolist() == [0, -1, 1, -1, 1]
    assert replace(fix, agree=None).without(np.array([True, True, False])).agree is None


def test_references_that_came_later_and_none_at_all_see_nothing() -> None:
    landmarks = mapped_room().landmarks
    later = landmarks.of_references(np.array([landmarks.references + 3, 2]))
    assert np.diff(later.starts).tolist() == [0, np.diff(landmarks.starts)[2]]
    assert np.diff(later.words.starts)[0] == 0
    assert len(landmarks.of_references(np.empty(0, np.int64))) == 0


def test_a_map_that_is_moved_takes_its_landmarks_along() -> None:
    map = mapped_room()
    motion = np.array([5.0, -2.0, 2.2])
    poses = np.array([compose(motion, pose) for pose in map.poses])
    moved = map.moved(poses)
    expected = np.array([compose(motion, (x, y, 0.0)) for x, y, _ in map.landmarks.points.tolist()])
    assert moved.landmarks.points[:, :2] == pytest.approx(expected[:, :2], abs=1e-4)
    assert (moved.landmarks.points[:, 2] == map.landmarks.points[:, 2]).all()
    assert (moved.poses == poses).all()


def test_deviations_of_poses_turn_with_a_map() -> None:
    map = mapped_room()
    sigmas = np.tile([0.1, 0.02, 0.01], (len(map.poses), 1))
    map = replace(map, landmarks=replace(map.landmarks, pose_sigmas=sigmas))
    turned = map.moved(compose(np.array([3.0, 1.0, np.pi / 2]), map.poses)).landmarks.pose_sigmas
    assert turned == pytest.approx(sigmas[:, [1, 0, 2]])
    assert map.moved(map.poses + np.array([1.0, 2.0, 0.0])).landmarks.pose_sigmas == pytest.approx(sigmas)


def test_a_landmark_moves_with_the_references_that_see_it() -> None:
    map = mapped_room()
    poses = map.poses.copy()
    right = poses[:, 0] > 6.0
    poses[right, 1] += 2.0
    moved = map.moved(poses).landmarks.points - map.landmarks.points
    assert moved[map.landmarks.points[:, 0] > 9.0, 1] == pytest.approx(2.0, abs=1e-4)
    assert moved[map.landmarks.points[:, 0] < 3.0] == pytest.approx(0.0, abs=1e-4)


def test_landmarks_of_more_references_than_the_map_has_are_a_contradiction() -> None:
    map = mapped_room()
    fewer = replace(map, poses=map.poses[:5], features=map.features[:5], edges=FEW)
    assert violation(fewer) == f"'landmarks' are of {len(map)} references, and the map has 5"
    other = replace(map.landmarks.words, centres=map.landmarks.words.centres[:, :64])
    assert violation(replace(map.landmarks, words=other)) == (
        "'words' are of descriptors of 64 numbers, those of the landmarks have 128"
    )
    grown = replace(map, poses=np.concatenate([map.poses, map.poses]), features=np.concatenate([map.features] * 2))
    assert violation(grown) is None


@pytest.mark.parametrize(
    ("field", "value", "said"),
    [
        ("points", np.array([[np.nan, 0.0, 0.0]], np.float32), "'points' holds nan"),
        ("points", np.array([[1e20, 0.0, 0.0]], np.float32), "'points' holds 1e+20"),
        ("points", np.zeros((2, 3), np.float32), "'descriptors' has the shape (1, 128)"),
        ("points", np.zeros((1, 2), np.float32), "'points' has the shape (1, 2)"),
        ("descriptors", np.zeros((1, 128), np.float32), "'descriptors' is an array of float32"),
        ("starts", np.array([0, 2, 1]), "'starts' does not ascend"),
        ("starts", np.array([0, 1, 3]), "'starts' does not ascend from 0 to 2"),
        ("starts", np.array([0, 1, 2, 2]), "'words' has the shape (2,)"),
        ("seen", np.array([0, 1], np.int32), "'seen' names a row that does not exist, expected 0 to 0"),
        ("seen", np.array([0, -1], np.int32), "'seen' names a row that does not exist"),
        ("sigma_rad", 0.0, "'sigma_rad' holds 0"),
        ("sigma_rad", float("nan"), "'sigma_rad' holds nan"),
    ],
)
def test_landmarks_that_contradict_themselves_are_said(field: str, value: object, said: str) -> None:
    whole = mapped_room().landmarks
    one = replace(
        whole.of_references(np.array([0, 1])),
        points=np.zeros((1, 3), np.float32),
        descriptors=np.zeros((1, 128), np.uint8),
        starts=np.array([0, 1, 2]),
        seen=np.zeros(2, np.int32),
    )
    assert violation(one) is None
    found = violation(replace(one, **{field: value}))
    assert found is not None
    assert said in found
