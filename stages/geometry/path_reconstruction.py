"""Where the robot was between two places that are certain: the way along the odometry, worked out from both ends."""

import numba
import numpy as np
import numpy.typing as npt

from .se2 import wrap

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

    `independent`: what is known of the last end does not come from the first one. Then each pose is what the way from
    the first end says of it, times what the way back from the last end says of it (ten Hagen & Kroese 2002, forwards
    and backwards): the two share no motion. Otherwise the last end is a filter's state, which knows the first end and
    the motions already and would count them twice; only what it has learned beyond them goes back along the way (Rauch,
    Tung & Striebel 1965), and row N is the last end as it is. Motions are linearised around the result of the round
    before, so that the result is the most likely way, also where the headings had to turn a lot.

    The third value is the squared Mahalanobis distance by which odometry misses the last end (3 degrees of freedom): a
    large one says that the robot was lifted, or that an end is wrong.
    """
    first, last = np.ascontiguousarray(first, np.float64), np.ascontiguousarray(last, np.float64)
    first_covariance = np.ascontiguousarray(first_covariance, np.float64)
    last_covariance = np.ascontiguousarray(last_covariance, np.float64)
    motions = np.ascontiguousarray(motions, np.float64).reshape(-1, 3)
    noise = np.ascontiguousarray(noise, np.float64).reshape(-1, 3, 3)
    backwards = _both_ways if independent else _back_from_the_filter
    at = _led(first, motions, noise)  # the way around which motions are linearised: at first where odometry leads
    covariances, missed = np.empty((len(at), 3, 3)), 0.0
    for turn in range(rounds):
        ahead, ahead_covariance = _ahead(first, first_covariance, motions, noise, at)
        if turn == 0:
            gap = _wrapped(last - ahead[-1])
            missed = float(gap @ np.linalg.solve(ahead_covariance[-1] + last_covariance, gap))
        at, covariances = backwards(motions, noise, at, ahead, ahead_covariance, last, last_covariance)
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
def _led(first: Array, motions: Array, noise: Array) -> Array:
    at = np.empty((len(motions) + 1, 3))
    at[0] = first
    for k in range(len(motions)):
        at[k + 1] = _linearised(at[k], motions[k], noise[k])[0]
    return at


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
def _both_ways(
    motions: Array, noise: Array, at: Array, ahead: Array, ahead_covariance: Array, last: Array, last_covariance: Array
) -> tuple[Array, Array]:
    fresh, covariances = np.empty(ahead.shape), np.empty(ahead_covariance.shape)
    back, back_covariance = last.copy(), last_covariance.copy()
    for k in range(len(at) - 1, -1, -1):
        share = ahead_covariance[k] @ np.linalg.inv(ahead_covariance[k] + back_covariance)
        fresh[k] = ahead[k] + share @ _wrapped(back - ahead[k])
        both = share @ back_covariance
        covariances[k] = 0.5 * (both + both.T)
        if k > 0:
            end, slope, spread = _linearised(at[k - 1], motions[k - 1], noise[k - 1])
            undo = np.linalg.inv(slope)
            back = at[k - 1] + undo @ _wrapped(back - end)
            back_covariance = undo @ (back_covariance + spread) @ undo.T
    return fresh, covariances


@numba.njit(cache=True, nogil=True)
def _back_from_the_filter(
    motions: Array, noise: Array, at: Array, ahead: Array, ahead_covariance: Array, last: Array, last_covariance: Array
) -> tuple[Array, Array]:
    fresh, covariances = np.empty(ahead.shape), np.empty(ahead_covariance.shape)
    n = len(at) - 1
    fresh[n], covariances[n] = ahead[n] + _wrapped(last - ahead[n]), last_covariance
    for k in range(n - 1, -1, -1):
        slope = _linearised(at[k], motions[k], noise[k])[1]
        gain = ahead_covariance[k] @ slope.T @ np.linalg.inv(ahead_covariance[k + 1])
        fresh[k] = ahead[k] + gain @ _wrapped(fresh[k + 1] - ahead[k + 1])
        # As a sum of what stays uncertain whatever the end is, and of the end's share: both are positive.
        kept = ahead_covariance[k] - gain @ slope @ ahead_covariance[k]
        both = kept + gain @ covariances[k + 1] @ gain.T
        covariances[k] = 0.5 * (both + both.T)
    return fresh, covariances
