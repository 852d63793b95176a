import math

import numpy as np
import pytest
from landmark_world import driven, misplaced

from omninav.stages.geometry.landmarks.closures import (
    candidate_pairs,
    carried_drive,
    straightened_drive,
    verified_pairs,
)
from omninav.stages.geometry.landmarks.map_making import LocalViews, local_views
from omninav.stages.geometry.plane.drive_graph import odometry_sigmas
from omninav.stages.geometry.plane.se2 import between, chain, compose, distances_along, wrap


@pytest.fixture(scope="module")
def verified(world, views, similarity):
    way = distances_along(world.poses)
    pairs = candidate_pairs(iter(similarity), way)
    apart = np.array([[5, 95], [20, 80]])  # in rooms that do not see each other
    return verified_pairs(views, np.concatenate([pairs, apart]), np.random.default_rng(2))


def straightened(odometry, verified):
    steps = between(odometry[:-1], odometry[1:])
    return straightened_drive(odometry[0], steps, odometry_sigmas(steps), verified)


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


LAPS = np.concatenate([np.arange(0, 120, 2), np.arange(1, 120, 2)])
"""Two laps around the house, each with every second image."""


@pytest.fixture(scope="module")
def laps(world, views, similarity):
    """True poses of two laps, their odometry and their verified pairs."""
    shown = [views.rows(each) for each in LAPS.tolist()]
    two = local_views([views.bearings[rows] for rows in shown], [views.descriptors[rows] for rows in shown])
    poses = world.poses[LAPS]
    pairs = candidate_pairs(iter(similarity[np.ix_(LAPS, LAPS)]), distances_along(poses))
    return poses, verified_pairs(two, pairs, np.random.default_rng(2))


def carried_in(laps, rows):
    """What tells of a robot that was carried over some steps: its drive as found, straightened, and the true poses."""
    poses, verified = laps
    steps, _ = driven(poses)
    steps[rows] = 0.0
    start = np.concatenate([poses[:1], compose(poses[0], chain(steps))])
    bent = straightened(start, verified)
    found = carried_drive(bent, steps, odometry_sigmas(steps), verified)
    return found, bent, straightened_drive(poses[0], *found[:2], verified, is_near=True), poses


@pytest.mark.parametrize("rows", [[23], [23, 71]])
def test_a_robot_that_was_carried_between_rooms_is_told_and_its_drive_is_straight(laps, rows):
    found, bent, straight, poses = carried_in(laps, rows)
    assert found.steps.tolist() == rows
    assert not len(found.unseen)
    assert misplaced(bent, poses)[0] > 1.0
    assert misplaced(straight, poses)[0] < 0.1
    others = np.delete(np.arange(len(found.motions)), rows)
    steps, _ = driven(poses)
    assert (found.motions[others] == steps[others]).all()


def test_a_robot_that_drove_between_rooms_unseen_was_not_carried(laps):
    found, _, straight, poses = carried_in(laps, [])
    assert not len(found.steps)
    assert not len(found.unseen)  # rooms are several metres from each other
    assert misplaced(straight, poses)[0] < 0.1


def test_where_several_steps_explain_the_closures_none_is_told(world, verified):
    """One lap comes back to its first room alone: any passage between two rooms may be the one."""
    steps, _ = driven(world.poses)
    steps[47] = 0.0
    start = np.concatenate([world.poses[:1], compose(world.poses[0], chain(steps))])
    found = carried_drive(straightened(start, verified), steps, odometry_sigmas(steps), verified)
    assert not len(found.steps)
    assert found.unseen.tolist() == [47]
    assert (found.motions == steps).all()
