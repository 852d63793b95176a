"""Reconstructs a path between two known poses from the odometry, by smoothing from both ends."""

import numpy as np

from omninav.pipeline.engine.compiled import compiled
from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.plane.se2 import chain, compose, wrap


def reconstruct_path(
    first: Array,
    first_covariance: Array,
    motions: Array,
    noise: Array,
    last: Array,
    last_covariance: Array,
    independent: bool = True,
    rounds: int = 5,
) -> tuple[Array, Array, float]:
    """Poses along a path whose ends are known, each as a Gaussian: means (N + 1, 3), covariances (N + 1, 3, 3).

    `first`, `last`: (3,) x, y (m), heading (rad), with covariances (3, 3). `motions`: (N, 3) increments along the path,
    each in the frame of where it began; `noise`: (N, 3, 3) their covariances in that frame. Row 0 is the first end, row
    N the last.

    `independent`: the last end is independent of the first, and the last pose is the product of both estimates.
    Otherwise the last end is a filter's state, which has used the first end and the motions already: it is the last
    pose as it is. Either way only the new information about the last pose is propagated back (Rauch, Tung & Striebel
    1965), which for independent ends equals the forward and backward passes of ten Hagen & Kroese 2002. Motions are
    linearised around the result of the previous round, so that the result is the most likely path, also with large
    turns.

    The third value is the squared Mahalanobis distance by which odometry misses the last end (3 degrees of freedom): a
    large one means that the robot was kidnapped or that an end is wrong.
    """
    first, last = np.ascontiguousarray(first, np.float64), np.ascontiguousarray(last, np.float64)
    first_covariance = np.ascontiguousarray(first_covariance, np.float64)
    last_covariance = np.ascontiguousarray(last_covariance, np.float64)
    motions = np.ascontiguousarray(motions, np.float64).reshape(-1, 3)
    noise = np.ascontiguousarray(noise, np.float64).reshape(-1, 3, 3)
    # The path around which motions are linearised: at first that of the odometry.
    at, missed = np.vstack([first, compose(first, chain(motions))]), 0.0
    for turn in range(rounds):
        forward, forward_covariance = _forward(first, first_covariance, motions, noise, at)
        gap, both = _wrapped(last - forward[-1]), forward_covariance[-1] + last_covariance
        if turn == 0:
            missed = float(gap @ np.linalg.solve(both, gap))
        share = forward_covariance[-1] @ np.linalg.inv(both) if independent else np.eye(3)
        covariance = share @ last_covariance
        at, covariances = _backward(
            motions, noise, at, forward, forward_covariance, forward[-1] + share @ gap, covariance
        )
    return np.column_stack([at[:, :2], wrap(at[:, 2])]), covariances, missed


@compiled(nogil=True)
def _wrapped(difference: Array) -> Array:
    difference[2] -= 2 * np.pi * np.floor((difference[2] + np.pi) / (2 * np.pi))
    return difference


@compiled(nogil=True)
def _linearised(pose: Array, motion: Array, noise: Array) -> tuple[Array, Array, Array]:
    # Where a motion leads from a pose, how that changes with the pose, and its noise in the map's frame.
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    dx, dy = cos * motion[0] - sin * motion[1], sin * motion[0] + cos * motion[1]
    end = np.array([pose[0] + dx, pose[1] + dy, pose[2] + motion[2]])
    slope = np.array([[1.0, 0.0, -dy], [0.0, 1.0, dx], [0.0, 0.0, 1.0]])
    turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    return end, slope, turn @ noise @ turn.T


@compiled(nogil=True)
def _forward(first: Array, first_covariance: Array, motions: Array, noise: Array, at: Array) -> tuple[Array, Array]:
    # The forward pass: each pose from the first end and the motions.
    forward, covariance = np.empty((len(at), 3)), np.empty((len(at), 3, 3))
    forward[0], covariance[0] = first, first_covariance
    for k in range(len(motions)):
        end, slope, spread = _linearised(at[k], motions[k], noise[k])
        forward[k + 1] = end + slope @ _wrapped(forward[k] - at[k])
        covariance[k + 1] = slope @ covariance[k] @ slope.T + spread
    return forward, covariance


@compiled(nogil=True)
def _backward(
    motions: Array,
    noise: Array,
    at: Array,
    forward: Array,
    forward_covariance: Array,
    last: Array,
    last_covariance: Array,
) -> tuple[Array, Array]:
    # The backward pass: all poses, from the forward pass and the last pose.
    smoothed, covariances = np.empty(forward.shape), np.empty(forward_covariance.shape)
    n = len(motions)
    smoothed[n], covariances[n] = last, 0.5 * (last_covariance + last_covariance.T)
    for k in range(n - 1, -1, -1):
        slope = _linearised(at[k], motions[k], noise[k])[1]
        gain = forward_covariance[k] @ slope.T @ np.linalg.inv(forward_covariance[k + 1])
        smoothed[k] = forward[k] + gain @ _wrapped(smoothed[k + 1] - forward[k + 1])
        # The sum of two positive parts: the uncertainty left with a known end, and the end's share.
        kept = forward_covariance[k] - gain @ slope @ forward_covariance[k]
        both = kept + gain @ covariances[k + 1] @ gain.T
        covariances[k] = 0.5 * (both + both.T)
    return smoothed, covariances
