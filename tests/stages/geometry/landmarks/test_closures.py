import math

import numpy as np
import pytest
from landmark_world import driven, misplaced, straightened

from omninav.stages.geometry.landmarks.closures import candidate_pairs, verified_pairs
from omninav.stages.geometry.landmarks.map_making import LocalViews, local_views
from omninav.stages.geometry.plane.se2 import between, distances_along, wrap


@pytest.fixture(scope="module")
def verified(world, views, similarity):
    way = distances_along(world.poses)
    pairs = candidate_pairs(iter(similarity), way)
    apart = np.array([[5, 95], [20, 80]])  # in rooms that do not see each other
    return verified_pairs(views, np.concatenate([pairs, apart]), np.random.default_rng(2))


def test_turn_and_direction_of_a_pair_are_those_of_the_motion(world, verified):
    one, other = verified.pairs.T
    true = between(world.poses[one], world.poses[other])
    far = np.hypot(true[:, 0], true[:, 1]) > 0.3
    turned = wrap(verified.turns - true[:, 2])
    towards = wrap(verified.directions - np.arctan2(true[:, 1], true[:, 0]))[far]
    assert len(one) > 300
    assert np.degrees(np.percentile(np.abs(turned), 95)) < 0.5
    assert np.degrees(np.percentile(np.abs(towards), 95)) < 2.0


def test_matches_that_agree_are_of_one_landmark_and_pairs_that_share_nothing_are_left_out(landmarks, views, verified):
    assert (landmarks[verified.first] == landmarks[verified.second]).mean() > 0.97
    assert (
        len(verified.first)
        == len(verified.second)
        == len(verified.ratio)
        == len(verified.owners)
        > 12 * len(verified.pairs)
    )
    assert (views.owners[verified.first] == verified.pairs[verified.owners, 0]).all()
    assert not {(5, 95), (20, 80)} & set(map(tuple, verified.pairs.tolist()))


def test_a_drive_that_odometry_has_bent_is_straightened(world, verified):
    _, odometry = driven(world.poses)
    straight = straightened(odometry, verified)
    assert misplaced(odometry, world.poses)[0] > 0.4
    assert misplaced(straight, world.poses)[0] < 0.06
    assert (straight[0] == odometry[0]).all()


def test_without_a_pair_odometry_stays(world, views):
    nothing = verified_pairs(views, np.zeros((0, 2), np.int64), np.random.default_rng(0))
    _, odometry = driven(world.poses)
    assert straightened(odometry, nothing) == pytest.approx(odometry, abs=1e-6)


def test_a_reference_without_features_has_no_pairs(views):
    starts, bearings, descriptors = views
    emptied = LocalViews(np.maximum(starts - starts[1], 0), bearings[starts[1] :], descriptors[starts[1] :])
    found = verified_pairs(emptied, np.array([[0, 1], [1, 2]]), np.random.default_rng(0))
    assert found.pairs.tolist() == [[1, 2]]


def test_candidates_are_predecessors_the_most_similar_and_the_most_similar_far_away():
    similarities = np.zeros((20, 20), np.float32)
    similarities[2, 17], similarities[2, 9] = 0.5, 0.9
    pairs = candidate_pairs(iter(similarities), np.arange(20) * 0.5)
    assert {(one - 1, one) for one in range(1, 20)} | {(2, 9), (2, 17)} <= set(map(tuple, pairs.tolist()))
    assert (pairs[:, 0] < pairs[:, 1]).all()
    assert len(np.unique(pairs, axis=0)) == len(pairs)


def test_where_a_pair_lies_is_measured_across_its_direction():
    odometry = np.column_stack([np.arange(4.0), np.zeros((4, 2))])
    verified = verified_pairs(
        local_views([np.zeros((0, 3))] * 4, []), np.zeros((0, 2), np.int64), np.random.default_rng(0)
    )._replace(pairs=np.array([[0, 3]]), turns=np.array([math.radians(3.0)]), directions=np.zeros(1))  # fmt: skip
    straight = straightened(odometry, verified)
    assert straight[3, 0] == pytest.approx(3.0, abs=0.1)
    assert 0.5 < np.degrees(straight[3, 2]) < 3.1
