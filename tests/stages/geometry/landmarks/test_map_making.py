import math

import numpy as np
import pytest
from landmark_world import NOISE

from omninav.stages.geometry.landmarks import map_making
from omninav.stages.geometry.landmarks.map_making import (
    bearing_sigma,
    fit_motion,
    fitting_matches,
    local_views,
    mean_descriptors,
    neighbouring_pairs,
    pair_matches,
    sightings_by_reference,
    similarity_rows,
    tracks_of,
    triangulated,
    widely_seen,
)


def tracks_between(views, pairs, poses):
    matches = pair_matches(views, pairs)
    return tracks_of(views, matches, fitting_matches(views, matches, poses))


@pytest.fixture(scope="module")
def pairs(world, similarity):
    return neighbouring_pairs(world.poses, iter(similarity), 0.5)


@pytest.fixture(scope="module")
def found(world, views, pairs):
    return triangulated(views, tracks_between(views, pairs, world.poses), world.poses)


def test_landmarks_lie_where_the_points_of_the_world_are(world, landmarks, found) -> None:
    own = landmarks[found.features]
    off = np.linalg.norm(found.points[found.landmarks] - world.points[own], axis=1)
    assert len(found.points) > 1000
    assert np.median(off) < 0.02
    assert np.percentile(off, 95) < 0.2


def test_sightings_of_a_landmark_are_of_one_point_from_different_references(views, landmarks, found) -> None:
    first = landmarks[found.features][np.searchsorted(found.landmarks, np.arange(len(found.points)))]
    assert (landmarks[found.features] == first[found.landmarks]).mean() > 0.99
    seen_by = np.column_stack([found.landmarks, views.owners[found.features]])
    assert len(np.unique(seen_by, axis=0)) == len(seen_by)
    assert np.bincount(found.landmarks).min() >= 2


@pytest.mark.parametrize("flip", [[1, -1, 1], [-1, 1, 1]])
def test_a_mirrored_camera_gives_next_to_no_landmarks(world, views, pairs, found, flip) -> None:
    flipped = views.looking_along(views.bearings * flip)
    mirrored = triangulated(flipped, tracks_between(flipped, pairs, world.poses), world.poses)
    assert len(mirrored.points) < 0.15 * len(found.points)


def test_the_deviation_of_bearings_is_that_of_the_images(world, views, found) -> None:
    assert bearing_sigma(views, found, world.poses) == pytest.approx(NOISE, rel=0.15)


def test_each_reference_has_the_landmarks_that_it_sees(views, found) -> None:
    starts, seen = sightings_by_reference(views, found)
    assert len(starts) == len(views) + 1
    for reference in (0, 50, len(views) - 1):
        own = found.landmarks[views.owners[found.features] == reference]
        assert sorted(seen[starts[reference] : starts[reference + 1]]) == sorted(own)


def test_a_landmark_looks_like_its_sightings_on_average(views, found, monkeypatch) -> None:
    means = mean_descriptors(views, found)
    assert np.linalg.norm(means, axis=1) == pytest.approx(1.0, abs=1e-5)
    alike = np.einsum("od,od->o", means[found.landmarks], views.compared(found.features))
    assert np.median(alike) > 0.97
    monkeypatch.setattr(map_making, "BLOCK", 7)  # not all at once
    assert mean_descriptors(views, found).tobytes() == means.tobytes()


def test_of_each_reference_the_landmarks_stay_that_most_references_see(views, found, monkeypatch) -> None:
    np.testing.assert_equal(widely_seen(views, found), found)  # few are all kept
    monkeypatch.setattr(map_making, "MAX_SEEN", 10)
    few = widely_seen(views, found)
    owners, counts = views.owners[found.features], np.bincount(found.landmarks)
    expected = set()
    for reference in range(len(views)):
        own = found.landmarks[owners == reference]
        expected |= set(sorted(own.tolist(), key=lambda each: (-counts[each], each))[:10])
    assert few.points.tolist() == found.points[sorted(expected)].tolist()
    assert np.bincount(few.landmarks).tolist() == counts[sorted(expected)].tolist()
    assert (found.points[found.landmarks[np.isin(found.features, few.features)]] == few.points[few.landmarks]).all()


def test_features_of_any_length_are_put_together_also_with_images_without_any() -> None:
    given = [np.empty((0, 128), np.uint8), np.full((2, 64), 1, np.uint8), np.full((1, 64), 2, np.uint8)]
    views = local_views([np.empty((0, 3)), np.eye(3)[:2], np.eye(3)[2:]], given)
    assert views.descriptors.tolist() == np.concatenate(given[1:]).tolist()
    assert views.owners.tolist() == [1, 1, 2]


def test_neighbours_are_the_most_similar_ones_within_reach_each_pair_once() -> None:
    poses = np.zeros((30, 3))
    poses[:, 0] = np.arange(30) * 0.15
    poses[29] = poses[28] + [0.05, 0.0, 0.0]  # too near to say anything of depths
    similarity = np.random.default_rng(0).random((30, 30)).astype(np.float32)
    pairs = neighbouring_pairs(poses, iter(similarity), 0.5)
    gaps = np.abs(np.diff(poses[pairs, 0], axis=1))
    assert gaps.min() > 0.1
    assert gaps.max() <= 2.0
    assert (pairs[:, 0] < pairs[:, 1]).all()
    assert len(np.unique(pairs, axis=0)) == len(pairs)
    there = [n for n in range(30) if 0.1 < abs(poses[n, 0] - poses[14, 0]) <= 2.0]
    best = sorted(there, key=lambda n: -similarity[14, n])[:10]
    assert {(min(14, n), max(14, n)) for n in best} <= set(map(tuple, pairs.tolist()))


def test_similarities_by_words_are_cosines() -> None:
    starts, words = np.array([0, 2, 3, 3]), np.array([0, 2, 2], np.int32)
    weights = np.array([0.6, 0.8, 1.0], np.float32)
    rows = np.array(list(similarity_rows(starts, words, weights, 4, np.arange(3))))
    assert rows == pytest.approx(np.array([[1.0, 0.8, 0.0], [0.8, 1.0, 0.0], [0.0, 0.0, 0.0]]))


def test_references_without_features_have_no_landmarks() -> None:
    views = local_views([np.empty((0, 3))] * 2, [np.empty((0, 128), np.uint8)] * 2)
    poses = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    found = triangulated(views, tracks_between(views, np.array([[0, 1]]), poses), poses)
    assert found.points.shape == (0, 3)
    assert mean_descriptors(views, found).shape == (0, 128)
    assert widely_seen(views, found).points.shape == (0, 3)
    assert sightings_by_reference(views, found)[0].tolist() == [0, 0, 0]
    assert bearing_sigma(views, found, poses) > 0.0
    assert neighbouring_pairs(np.empty((0, 3)), iter(()), 0.5).shape == (0, 2)


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
