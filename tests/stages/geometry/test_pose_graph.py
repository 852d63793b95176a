"""Pose graphs in the plane."""

import numpy as np
import pytest

from omninav.stages.geometry.plane.pose_graph import optimised_poses
from omninav.stages.geometry.plane.se2 import between, chain, wrap

TURNS = np.tile([1.0, 0.0, 2 * np.pi / 40], (40, 1))
TRUTH = np.concatenate([np.zeros((1, 3)), chain(TURNS)])  # a circle, closed
STEPS = between(TRUTH[:-1], TRUTH[1:]) + np.array([0.0, 0.0, 0.01])  # odometry that turns a little more
DRIVEN = np.concatenate([np.zeros((1, 3)), chain(STEPS)])
ALONG = np.column_stack([np.arange(40), np.arange(1, 41)])


def straightened(pairs, motions, doubtful=True):
    edges = np.concatenate([ALONG, np.array(pairs).reshape(-1, 2)])
    measured = np.concatenate([STEPS, np.array(motions, dtype=float).reshape(-1, 3)])
    sigmas = np.tile([0.05, 0.05, 0.02], (len(edges), 1))
    return optimised_poses(DRIVEN, edges, measured, sigmas, (np.arange(len(edges)) >= 40) & doubtful)


def error(poses):
    return float(np.hypot(*(poses - TRUTH)[:, :2].T).max())


def test_without_a_closure_nothing_moves():
    poses, _ = straightened(np.zeros((0, 2), np.int64), [])
    assert poses == pytest.approx(DRIVEN, abs=1e-6)


def test_one_closure_straightens_a_circle():
    poses, weights = straightened([[0, 40]], [[0.0, 0.0, 0.0]])
    assert error(DRIVEN) > 2.0
    assert error(poses) < 0.2
    assert weights[-1] > 0.5


def test_the_first_pose_stays_and_a_motion_is_met_in_its_own_frame():
    poses, _ = straightened([[0, 20]], [between(TRUTH[0], TRUTH[20])])
    assert (poses[0] == DRIVEN[0]).all()
    gap = between(poses[0], poses[20]) - between(TRUTH[0], TRUTH[20])
    assert np.abs([gap[0], gap[1], wrap(gap[2])]).max() < 0.1


def test_a_wrong_closure_is_outvoted_only_where_it_is_doubted():
    pairs, motions = (
        [[0, 40], [1, 39], [2, 38], [0, 20]],
        [[0, 0, 0], *between(TRUTH[[1, 2]], TRUTH[[39, 38]]), [0, 0, 0]],
    )
    doubted, weights = straightened(pairs, motions)
    believed, _ = straightened(pairs, motions, doubtful=False)
    assert error(doubted) < 0.3
    assert weights[-1] < 0.05
    assert error(believed) > 2.0
