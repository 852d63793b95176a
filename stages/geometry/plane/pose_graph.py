"""Pose graphs in the plane: poses that agree best with measured motions between them, some of which are wrong."""

from typing import Any

import numpy as np

from omninav.stages.geometry.arrays import Array, Bools, Ints

from .se2 import between, wrap

PRIOR = 1e-9
"""Weight of each pose staying where it is, which keeps parts without a measurement in place."""
EASING = 1.4
"""Factor by which the Cauchy scale shrinks per iteration."""
CONVERGED = 1e-6
"""Largest change (m, rad) of a step at which it ends."""
MAX_STEPS = 100
"""Largest number of steps."""


def optimised_poses(poses: Array, edges: Ints, measured: Array, sigmas: Array, doubtful: Bools) -> tuple[Array, Array]:
    """The poses (N, 3) that agree best with measured motions, and the weight (E,) that each measurement was left.

    `edges` (E, 2): from which pose to which; `measured` (E, 3): the motion between them in the first one's frame;
    `sigmas` (E, 3): their standard deviations (m, m, rad). The first pose stays. Gauss-Newton on sparse normal
    equations; a `doubtful` measurement counts by Cauchy's function of its squared error e, as a weight 1 / (1 + e / c)
    in each step (iteratively reweighted least squares): without it one wrong loop bends the whole graph. c falls from
    the largest error to 1, so that a right loop that odometry contradicts far is not given up at once (graduated
    non-convexity: Yang, Antonante, Tzoumas & Carlone 2020).
    """
    from scipy import sparse  # slow to import, and seldom needed
    from scipy.sparse.linalg import splu

    poses = poses.copy()
    one, other = edges.T
    weights = np.ones(len(edges))
    scale = np.inf
    damping = sparse.diags_array(np.full(3 * len(poses) - 3, PRIOR), format="csc")
    for _ in range(MAX_STEPS):
        error = between(poses[one], poses[other]) - measured
        error[:, 2] = wrap(error[:, 2])
        error /= sigmas
        squares = (error**2).sum(axis=1)
        scale = max(1.0, min(squares[doubtful].max(initial=0.0), scale / EASING))
        weights = np.where(doubtful, 1.0 / (1.0 + squares / scale), 1.0)
        root = np.sqrt(weights)
        jacobian = motion_jacobian(poses, edges, root[:, None] / sigmas)[:, 3:]
        normal = (jacobian.T @ jacobian + damping).tocsc()
        step = splu(normal).solve(-(jacobian.T @ (error * root[:, None]).ravel()))
        poses[1:] += step.reshape(-1, 3)
        poses[:, 2] = wrap(poses[:, 2])
        if scale == 1.0 and np.abs(step).max() < CONVERGED:
            break
    return poses, weights


def motion_jacobian(poses: Array, edges: Ints, scale: Array, freedoms: int = 3) -> Any:
    """Jacobian of `between`, times `scale` (E, 3), as a sparse matrix (3 E, `freedoms` N).

    `freedoms`: columns of each pose, of which the first three are x, y and heading.
    """
    from scipy import sparse

    one, other = edges.T
    rows = 3 * np.arange(len(edges))
    cos, sin = np.cos(poses[one, 2]), np.sin(poses[one, 2])
    dx, dy = (poses[other, :2] - poses[one, :2]).T
    unit = np.ones(len(one))
    entries = (  # row, column from which pose, which of its three, derivative
        (0, one, 0, -cos),
        (0, one, 1, -sin),
        (0, one, 2, -sin * dx + cos * dy),
        (0, other, 0, cos),
        (0, other, 1, sin),
        (1, one, 0, sin),
        (1, one, 1, -cos),
        (1, one, 2, -cos * dx - sin * dy),
        (1, other, 0, -sin),
        (1, other, 1, cos),
        (2, one, 2, -unit),
        (2, other, 2, unit),
    )
    values = np.concatenate([scale[:, row] * value for row, _, _, value in entries])
    places = (
        np.concatenate([rows + row for row, _, _, _ in entries]),
        np.concatenate([freedoms * pose + column for _, pose, column, _ in entries]),
    )
    return sparse.coo_array((values, places), shape=(3 * len(one), freedoms * len(poses))).tocsc()
