import math

import numpy as np
import pytest
from landmark_world import driven, misplaced, straightened

from omninav.stages.geometry.landmarks.carried_drive import CarriedDrive, _carried, _mode, carried_drive
from omninav.stages.geometry.landmarks.closures import (
    VerifiedPairs,
    candidate_pairs,
    verified_pairs,
)
from omninav.stages.geometry.landmarks.map_making import local_views
from omninav.stages.geometry.plane.drive_graph import odometry_sigmas
from omninav.stages.geometry.plane.se2 import between, chain, compose, distances_along

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
    """Carries a robot over some steps. Returns its drive as found and as straightened before, and the true poses."""
    poses, verified = laps
    steps, _ = driven(poses)
    steps[rows] = 0.0
    start = np.concatenate([poses[:1], compose(poses[0], chain(steps))])
    bent = straightened(start, verified)
    found = carried_drive(bent, steps, odometry_sigmas(steps), verified)
    return found, bent, poses


def test_a_robot_that_was_carried_between_rooms_is_told_and_its_drive_is_straight(laps):
    rows = [23, 71]
    found, bent, poses = carried_in(laps, rows)
    assert found.steps.tolist() == rows
    assert not len(found.unseen)
    assert misplaced(bent, poses)[0] > 1.0
    assert misplaced(found.poses, poses)[0] < 0.1
    true = between(poses[:-1], poses[1:])
    assert between(found.poses[:-1], found.poses[1:])[rows] == pytest.approx(true[rows], abs=0.2)
    others = np.delete(np.arange(len(found.motions)), rows)
    steps, _ = driven(poses)
    assert (found.motions[others] == steps[others]).all()


def test_a_robot_that_drove_between_rooms_unseen_was_not_carried(laps):
    found, _, poses = carried_in(laps, [])
    assert not len(found.steps)
    assert not len(found.unseen)  # rooms are several metres from each other
    assert misplaced(found.poses, poses)[0] < 0.1


def test_the_motion_of_a_carried_step_is_what_most_of_the_spanning_pairs_show():
    rng, step = np.random.default_rng(1), 9
    steps = rng.normal(size=(19, 3)) * [0.5, 0.5, 0.4]
    steps[step] = 4.0, -3.0, 2.5
    first = np.array([1.0, 2.0, 0.5])
    poses = np.concatenate([first[None], compose(first, chain(steps))])
    pairs = np.array([(one, other) for one in range(step + 1) for other in range(step + 1, 20)])
    motions = between(poses[pairs[:, 0]], poses[pairs[:, 1]])
    turns, directions = motions[:, 2].copy(), np.arctan2(motions[:, 1], motions[:, 0])
    wrong = rng.random(len(pairs)) < 0.3
    turns[wrong], directions[wrong] = rng.uniform(-math.pi, math.pi, (2, np.count_nonzero(wrong)))
    nothing = np.empty(0, np.int64)
    verified = VerifiedPairs(pairs, turns, directions, nothing, nothing, np.empty(0), nothing)
    measured = steps.copy()
    measured[step] = 0.0
    bent, sigmas = np.concatenate([first[None], compose(first, chain(measured))]), np.full((19, 3), 0.01)
    found = _carried(CarriedDrive(bent, measured, sigmas, nothing, nothing), step, verified)
    assert found.motions[step, :2] == pytest.approx(steps[step, :2], abs=0.1)
    assert found.motions[step, 2] == pytest.approx(steps[step, 2], abs=math.radians(3.0))
    assert (np.delete(found.motions, step, axis=0) == np.delete(steps, step, axis=0)).all()
    assert found.steps.tolist() == [step]
    assert (found.sigmas[step] > 1.0).all()
    few = VerifiedPairs(pairs[:5], turns[:5], directions[:5], nothing, nothing, np.empty(0), nothing)
    assert (carried_drive(bent, measured, sigmas, few).motions == measured).all()


@pytest.mark.parametrize("turned", [0.0, 3.0])
def test_the_mode_of_angles_is_that_of_most_across_the_half_turn_too(turned):
    angles = np.concatenate([np.linspace(-0.2, 0.2, 21), np.linspace(1.0, 1.1, 20)]) + turned
    assert np.exp(1j * _mode(angles, 0.25)) == pytest.approx(np.exp(1j * turned), abs=1e-6)
    assert np.exp(1j * _mode(angles, 0.05)) == pytest.approx(np.exp(1j * (1.05 + turned)), abs=1e-6)


def test_where_several_steps_explain_the_closures_none_is_told(world, views, similarity):
    """One lap comes back to its first room alone: any passage between two rooms may be the one."""
    pairs = candidate_pairs(iter(similarity), distances_along(world.poses))
    verified = verified_pairs(views, pairs, np.random.default_rng(2))
    steps, _ = driven(world.poses)
    steps[47] = 0.0
    start = np.concatenate([world.poses[:1], compose(world.poses[0], chain(steps))])
    found = carried_drive(straightened(start, verified), steps, odometry_sigmas(steps), verified)
    assert not len(found.steps)
    assert found.unseen.tolist() == [47]
    assert (found.motions == steps).all()
