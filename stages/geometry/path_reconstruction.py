"""Where the robot was between two places that are certain: the way along the odometry, worked out from both ends."""

import numba
import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def reconstructed(
    first: Array,
    first_covariance: Array,
    motions: Array,
    noise: Array,
    last: Array,
    last_covariance: Array,
    rounds: int = 5,
) -> tuple[Array, Array, float]:
    """Poses along a way whose two ends are known, each as a Gaussian: means (N + 1, 3), covariances (N + 1, 3, 3).

    `first`, `last`: (3,) x, y (m), heading (rad), with covariances (3, 3), independent of each other. `motions`: (N, 3)
    increments along the way, each in the frame of where it began; `noise`: (N, 3, 3) their covariances in that frame.
    Row 0 is the first end, row N the last.

    Each pose is what the way from the first end says of it, times what the way back from the last end says of it
    (ten Hagen & Kroese 2002, forwards and backwards): the two share no motion. Motions are linearised around the
    result of the round before, so that the result is the most likely way, also where the headings had to turn a lot.

    The third value is the squared Mahalanobis distance by which odometry misses the last end (3 degrees of freedom): a
    large one says that the robot was lifted, or that an end is wrong.
    """
    means, covariances, missed = _reconstructed(
        np.ascontiguousarray(first, np.float64),
        np.ascontiguousarray(first_covariance, np.float64),
        np.ascontiguousarray(motions, np.float64).reshape(-1, 3),
        np.ascontiguousarray(noise, np.float64).reshape(-1, 3, 3),
        np.ascontiguousarray(last, np.float64),
        np.ascontiguousarray(last_covariance, np.float64),
        rounds,
    )
    return means, covariances, float(missed)


@numba.njit(cache=True, nogil=True)
def _wrapped(difference: Array) -> Array:
    difference[2] -= 2 * np.pi * np.floor((difference[2] + np.pi) / (2 * np.pi))
    return difference


@numba.njit(cache=True, nogil=True)
def _linearised(pose: Array, motion: Array, noise: Array) -> tuple[Array, Array, Array]:
    # Where a motion leads from a pose, how that changes with the pose, and its noise in the map's frame.
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    dx, dy = cos * motion[0] - sin * motion[1], sin * motion[0] + cos * motion[1]
    end = np.array([pose[0] + dx, pose[1] + dy, pose[2] + motion[2]])
    slope = np.array([[1.0, 0.0, -dy], [0.0, 1.0, dx], [0.0, 0.0, 1.0]])
    turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    return end, slope, turn @ noise @ turn.T


@numba.njit(cache=True, nogil=True)
def _reconstructed(
    first: Array,
    first_covariance: Array,
    motions: Array,
    noise: Array,
    last: Array,
    last_covariance: Array,
    rounds: int,
) -> tuple[Array, Array, float]:
    number = len(motions) + 1
    at = np.empty((number, 3))  # the way around which motions are linearised: at first where odometry leads
    at[0] = first
    for k in range(1, number):
        at[k] = _linearised(at[k - 1], motions[k - 1], noise[k - 1])[0]
    covariances = np.empty((number, 3, 3))
    ahead, ahead_covariance = np.empty((number, 3)), np.empty((number, 3, 3))
    missed = 0.0
    for turn in range(rounds):
        ahead[0], ahead_covariance[0] = first, first_covariance
        for k in range(1, number):
            end, slope, spread = _linearised(at[k - 1], motions[k - 1], noise[k - 1])
            ahead[k] = end + slope @ _wrapped(ahead[k - 1] - at[k - 1])
            ahead_covariance[k] = slope @ ahead_covariance[k - 1] @ slope.T + spread
        back, back_covariance = last.copy(), last_covariance.copy()
        if turn == 0:
            gap = _wrapped(back - ahead[number - 1])
            missed = float(gap @ np.linalg.solve(ahead_covariance[number - 1] + back_covariance, gap))
        fresh = np.empty((number, 3))
        for k in range(number - 1, -1, -1):
            share = ahead_covariance[k] @ np.linalg.inv(ahead_covariance[k] + back_covariance)
            fresh[k] = ahead[k] + share @ _wrapped(back - ahead[k])
            both = share @ back_covariance
            covariances[k] = 0.5 * (both + both.T)
            if k > 0:
                end, slope, spread = _linearised(at[k - 1], motions[k - 1], noise[k - 1])
                undo = np.linalg.inv(slope)
                back = at[k - 1] + undo @ _wrapped(back - end)
                back_covariance = undo @ (back_covariance + spread) @ undo.T
        at = fresh
    for k in range(number):
        at[k] = _wrapped(at[k])
    return at, covariances, missed
