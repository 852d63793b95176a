"""Against the whole system, by differences of the residuals."""

from itertools import pairwise

import numpy as np
import pytest
from landmark_world import rotations

from omninav.stages.geometry.landmarks.schur_complement import (
    Poses,
    Sightings,
    covisibility,
    eliminate,
    landmark_steps,
    residuals,
)

REFERENCES = np.array([0, 2, 3, 1, 1, 2, 0, 1, 2, 3])  # the second landmark is seen twice by one reference
SIGHTINGS = Sightings(REFERENCES, np.array([0, 3, 6, 10]))
DAMPING = 0.3


@pytest.fixture
def problem():
    rng = np.random.default_rng(0)
    poses = rng.normal(size=(4, 3))
    points = rng.normal([4.0, 0.0, 1.0], 1.0, (3, 3))
    bearings = rng.normal(size=(10, 3))
    return poses, points, bearings / np.linalg.norm(bearings, axis=1)[:, None], rng.normal(size=(10, 3, 2)), rng


def placed(poses):
    """The positions (R, 3) of poses (R, 3), or (R, 4) with a height."""
    places = np.zeros((len(poses), 3))
    places[:, :2], places[:, 2:] = poses[:, :2], poses[:, 3:] if poses.shape[1] > 3 else 0.0
    return places


def missed(values, bearings, lens):
    poses, camera, points = values[:-11].reshape(4, -1), values[-11:-9], values[-9:].reshape(3, 3)
    return residuals(placed(poses), rotations(poses), points, *SIGHTINGS, bearings + lens @ camera).ravel()


@pytest.mark.parametrize("rises", [False, True])
def test_a_step_is_that_of_the_whole_system(problem, rises):
    poses, points, bearings, lens, rng = problem
    if rises:
        poses = np.column_stack([poses, rng.normal(0.0, 0.1, 4)])
    freedoms, size = poses.shape[1], poses.size
    weights = rng.uniform(0.5, 2.0, 10)
    values = np.concatenate([poses.ravel(), np.zeros(2), points.ravel()])
    jacobian = np.stack([
        (missed(values + step, bearings, lens) - missed(values - step, bearings, lens)) / 2e-6
        for step in 1e-6 * np.eye(len(values))
    ], axis=1)  # fmt: skip
    weighted = jacobian * np.repeat(weights, 3)[:, None]
    square, gradient = weighted.T @ jacobian, weighted.T @ missed(values, bearings, lens)
    damped = square + DAMPING * np.diag(np.diag(square))
    expected = -np.linalg.solve(damped, gradient)

    frames = Poses(placed(poses), rotations(poses), np.tile([[[0.0, 0.0, 1.0]]], (4, 1, 1)), rises)
    pattern = covisibility(SIGHTINGS, 4)
    system = eliminate(frames, points, SIGHTINGS, bearings, lens, weights, DAMPING, pattern)
    whole = np.zeros((size + 2, size + 2))
    for one in range(4):
        here = slice(freedoms * one, freedoms * (one + 1))
        whole[here, here] = system.diagonal[one] + DAMPING * np.diag(system.curvature[one])
        for at in range(pattern[0][one], pattern[0][one + 1]):
            other = pattern[1][at]
            there = slice(freedoms * other, freedoms * (other + 1))
            whole[here, there] = system.upper[at]
            whole[there, here] = system.upper[at].T
    whole[:size, size:] = system.border.reshape(size, 2)
    whole[size:, :size] = whole[:size, size:].T
    whole[size:, size:] = system.corner + DAMPING * np.diag(system.curvature_camera)
    step = -np.linalg.solve(whole, np.concatenate([system.right.ravel(), system.right_camera]))
    assert step == pytest.approx(expected[:-9], rel=1e-5, abs=1e-8)
    back = landmark_steps(system, SIGHTINGS, step[:size].reshape(4, -1), step[size:])
    assert back.ravel() == pytest.approx(expected[-9:], rel=1e-5, abs=1e-8)


def test_references_that_share_a_landmark_are_listed_once():
    starts, others = covisibility(SIGHTINGS, 4)
    assert [others[a:b].tolist() for a, b in pairwise(starts)] == [[1, 2, 3], [2, 3], [3], []]
