"""Pose graphs in the plane."""

import numpy as np
import pytest

from omninav.stages.geometry.plane.pose_graph import motion_jacobian, optimised_poses
from omninav.stages.geometry.plane.se2 import between, chain

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


def test_the_first_pose_stays_and_a_doubtful_motion_counts_by_cauchys_function():
    # A metre ahead along y, against 3.4: at 1.4 that is off by 2, of a weight of 1 / (1 + 2^2), and 0.4 = 0.2 x 2.
    poses = np.array([[0.0, 0.0, np.pi / 2], [0.0, 1.0, np.pi / 2]])
    measured = np.array([[1.0, 0.0, 0.0], [3.4, 0.0, 0.0]])
    found, weights = optimised_poses(poses, np.array([[0, 1], [0, 1]]), measured, np.ones((2, 3)), np.arange(2) == 1)
    assert found == pytest.approx(np.array([[0.0, 0.0, np.pi / 2], [0.0, 1.4, np.pi / 2]]), abs=1e-5)
    assert weights == pytest.approx([1.0, 0.2], abs=1e-5)


def test_the_jacobian_is_that_of_small_differences():
    rng, edges = np.random.default_rng(0), np.array([[0, 1], [2, 0]])
    poses, scale = rng.normal(size=(3, 3)), rng.uniform(1.0, 2.0, (2, 3))
    for column, found in enumerate(motion_jacobian(poses, edges, scale).toarray().T):
        step = 1e-6 * (np.arange(9) == column).reshape(3, 3)
        after, before = (between(*each[edges.T]) for each in (poses + step, poses - step))
        assert found == pytest.approx(((after - before) * scale / 2e-6).ravel(), abs=1e-6)


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
