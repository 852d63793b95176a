"""Where the robot was between two places that are certain: the way along the odometry, worked out from both ends."""

import numba
import numpy as np
import numpy.typing as npt

from .se2 import chain, compose, wrap

Array = npt.NDArray[np.float64]


def reconstructed(
    first: Array,
    first_covariance: Array,
    motions: Array,
    noise: Array,
    last: Array,
    last_covariance: Array,
    independent: bool = True,
    rounds: int = 5,
) -> tuple[Array, Array, float]:
    """Poses along a way whose two ends are known, each as a Gaussian: means (N + 1, 3), covariances (N + 1, 3, 3).

    `first`, `last`: (3,) x, y (m), heading (rad), with covariances (3, 3). `motions`: (N, 3) increments along the way,
    each in the frame of where it began; `noise`: (N, 3, 3) their covariances in that frame. Row 0 is the first end, row
    N the last.

    `independent`: what is known of the last end does not come from the first one, and the last pose is what the way
    from the first end says of it, times the last end. Otherwise the last end is a filter's state, which knows the first
    end and the motions already and would count them twice: it is the last pose as it is. Either way only what is known
    of the last pose beyond the way goes back along it (Rauch, Tung & Striebel 1965), which for independent ends is what
    ten Hagen & Kroese 2002 have forwards and backwards. Motions are linearised around the result of the round before,
    so that the result is the most likely way, also where the headings had to turn a lot.

    The third value is the squared Mahalanobis distance by which odometry misses the last end (3 degrees of freedom): a
    large one says that the robot was lifted, or that an end is wrong.
    """
    first, last = np.ascontiguousarray(first, np.float64), np.ascontiguousarray(last, np.float64)
    first_covariance = np.ascontiguousarray(first_covariance, np.float64)
    last_covariance = np.ascontiguousarray(last_covariance, np.float64)
    motions = np.ascontiguousarray(motions, np.float64).reshape(-1, 3)
    noise = np.ascontiguousarray(noise, np.float64).reshape(-1, 3, 3)
    # The way around which motions are linearised: at first where odometry leads.
    at, missed = np.vstack([first, compose(first, chain(motions))]), 0.0
    for turn in range(rounds):
        ahead, ahead_covariance = _ahead(first, first_covariance, motions, noise, at)
        gap, both = _wrapped(last - ahead[-1]), ahead_covariance[-1] + last_covariance
        if turn == 0:
            missed = float(gap @ np.linalg.solve(both, gap))
        share = ahead_covariance[-1] @ np.linalg.inv(both) if independent else np.eye(3)
        covariance = share @ last_covariance
        at, covariances = _back(motions, noise, at, ahead, ahead_covariance, ahead[-1] + share @ gap, covariance)
    return np.column_stack([at[:, :2], wrap(at[:, 2])]), covariances, missed


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
def _ahead(first: Array, first_covariance: Array, motions: Array, noise: Array, at: Array) -> tuple[Array, Array]:
    # What the first end and the motions say of each pose.
    ahead, covariance = np.empty((len(at), 3)), np.empty((len(at), 3, 3))
    ahead[0], covariance[0] = first, first_covariance
    for k in range(len(motions)):
        end, slope, spread = _linearised(at[k], motions[k], noise[k])
        ahead[k + 1] = end + slope @ _wrapped(ahead[k] - at[k])
        covariance[k + 1] = slope @ covariance[k] @ slope.T + spread
    return ahead, covariance


@numba.njit(cache=True, nogil=True)
def _back(
    motions: Array, noise: Array, at: Array, ahead: Array, ahead_covariance: Array, last: Array, last_covariance: Array
) -> tuple[Array, Array]:
    # All poses, from what the way so far says of them and what is known of the last one.
    fresh, covariances = np.empty(ahead.shape), np.empty(ahead_covariance.shape)
    n = len(motions)
    fresh[n], covariances[n] = last, 0.5 * (last_covariance + last_covariance.T)
    for k in range(n - 1, -1, -1):
        slope = _linearised(at[k], motions[k], noise[k])[1]
        gain = ahead_covariance[k] @ slope.T @ np.linalg.inv(ahead_covariance[k + 1])
        fresh[k] = ahead[k] + gain @ _wrapped(fresh[k + 1] - ahead[k + 1])
        # As a sum of what stays uncertain whatever the end is, and of the end's share: both are positive.
        kept = ahead_covariance[k] - gain @ slope @ ahead_covariance[k]
        both = kept + gain @ covariances[k + 1] @ gain.T
        covariances[k] = 0.5 * (both + both.T)
    return fresh, covariances
