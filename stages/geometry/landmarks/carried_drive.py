"""A drive whose robot was carried on its way, as while its recording paused: found by what closures show."""

import math
from typing import NamedTuple

import numpy as np

from omninav.stages.geometry.arrays import Array, Bools, Ints
from omninav.stages.geometry.plane.se2 import between, chain, compose, distances_along, wrap

from .closures import FAR_M, VerifiedPairs, straightened_drive

CARRIED_SIGMAS = (100.0, 100.0, math.pi)
"""Standard deviations (m, m, rad) of a motion in which the robot was carried."""
MISS_M, ROUNDS = 0.5, 10
"""Distance (m) of a place from a pair's line of sight at which the pair counts by half, and number of reweightings."""
UNSEEN_M = 0.5
"""Distance by odometry within which two consecutive images should share something, m."""
MAX_DOUBTFUL = 10
"""Largest number of steps of a drive in which the robot may have been carried: with more its images show too little."""
MIN_DISAGREEING = 6
"""Smallest number of pairs that must cease to disagree once the robot was carried in a step, and by which fewer must be
left than with any other step."""
AGREED_TURN, AGREED_DIRECTION = math.radians(2.0), math.radians(15.0)
"""Largest differences from poses of a pair that agrees with them: of its turn and its direction (rad)."""


class CarriedDrive(NamedTuple):
    """Poses (R, 3) of a straightened drive, its motions (R - 1, 3) and their standard deviations (R - 1, 3).

    `steps` (S,): those in which the robot was carried, whose motions are what the closures show. `unseen` (U,): those
    that are short by odometry and spanned by no near pair, of which the closures show nothing else.
    """

    poses: Array
    motions: Array
    sigmas: Array
    steps: Ints
    unseen: Ints


def carried_drive(poses: Array, steps: Array, sigmas: Array, verified: VerifiedPairs) -> CarriedDrive:
    """Finds the steps of a drive in which the robot was carried, as while its recording paused.

    `poses` (R, 3): the drive straightened by `straightened_drive` of the same `steps`, `sigmas` and `verified`. No near
    pair spans such a step, and with the motion that closures give it in place of odometry's, fewer pairs disagree, by
    half of those at least that span it and disagreed. Where another step explains the closures as well nobody knows.
    """
    doubtful = _unspanned(steps, verified)
    if len(doubtful) > MAX_DOUBTFUL:
        doubtful = []
    short = [step for step in doubtful if math.hypot(steps[step, 0], steps[step, 1]) < UNSEEN_M]
    found = same = CarriedDrive(poses, steps, sigmas, np.empty(0, np.int64), np.array(short, np.int64))
    disagreeing, is_clear = ~_agreeing(poses, verified), True
    while doubtful := [step for step in doubtful if _is_contradicted(step, disagreeing, verified)]:
        tried = [_carried(found, step, verified) for step in doubtful]
        wrong = [~_agreeing(each.poses, verified) for each in tried]
        left = np.array([np.count_nonzero(each) for each in wrong])
        best = int(np.argmin(left))
        step = doubtful.pop(best)
        doubted = np.count_nonzero(disagreeing & _spanning(step, verified))
        if np.count_nonzero(disagreeing) - left[best] < max(MIN_DISAGREEING, doubted / 2):
            break
        is_clear = bool((np.delete(left, best) - left[best] >= MIN_DISAGREEING).all())
        disagreeing, found = wrong[best], tried[best]
    if not is_clear:
        return same
    return found._replace(unseen=np.setdiff1d(found.unseen, found.steps))


def _is_contradicted(step: int, disagreeing: Bools, verified: VerifiedPairs) -> bool:
    """Tells whether at least a quarter of the pairs that span a step disagree, and enough of them."""
    spanning = _spanning(step, verified)
    doubted = np.count_nonzero(disagreeing & spanning)
    return bool(doubted >= max(MIN_DISAGREEING, np.count_nonzero(spanning) / 4))


def _spanning(step: int, verified: VerifiedPairs) -> Bools:
    return (verified.pairs[:, 0] <= step) & (verified.pairs[:, 1] > step)


def _carried(drive: CarriedDrive, step: int, verified: VerifiedPairs) -> CarriedDrive:
    """The drive with another motion in a step: that with which most of the pairs agree that span it."""
    first = drive.poses[0]
    poses = np.concatenate([first[None], compose(first, chain(drive.motions))])
    spanning = _spanning(step, verified)
    one, other = verified.pairs[spanning].T
    start, then = poses[step], poses[step + 1]
    turns = poses[one, 2] + verified.turns[spanning] - poses[other, 2]
    turn = _mode(turns, AGREED_DIRECTION)
    agreeing = np.abs(wrap(turns - turn)) < AGREED_DIRECTION
    one, other, towards = one[agreeing], other[agreeing], (poses[one, 2] + verified.directions[spanning])[agreeing]
    ends = compose(np.array([*then[:2], then[2] + turn]), between(then, poses[other]))
    across = np.column_stack([-np.sin(towards), np.cos(towards)])
    missing = np.einsum("pi,pi->p", across, poses[one, :2] - ends[:, :2])
    by, weights = np.zeros(2), np.ones(len(missing))
    for _ in range(ROUNDS):
        by = np.linalg.lstsq(across * weights[:, None], missing * weights, rcond=None)[0]
        weights = 1.0 / np.sqrt(1.0 + ((across @ by - missing) / MISS_M) ** 2)
    motions, sigmas = drive.motions.copy(), drive.sigmas.copy()
    motions[step] = between(start, np.array([*(then[:2] + by), then[2] + turn]))
    sigmas[step] = CARRIED_SIGMAS
    straight = straightened_drive(first, motions, sigmas, verified, is_near=True)
    return CarriedDrive(straight, motions, sigmas, np.sort(np.append(drive.steps, step)), drive.unseen)


def _mode(angles: Array, within: float) -> float:
    """The middle of the arc of twice `within` (rad) that holds most of the angles (N,)."""
    ordered = np.sort(wrap(angles))
    around = np.concatenate([ordered, ordered + 2.0 * math.pi])
    ends = np.searchsorted(around, ordered + 2.0 * within, side="right")
    first = int(np.argmax(ends - np.arange(len(ordered))))
    return float(np.median(around[first : ends[first]]))


def _unspanned(steps: Array, verified: VerifiedPairs) -> list[int]:
    """Steps of a drive that no pair of references near to each other along it spans."""
    driven = distances_along(np.concatenate([np.zeros((1, 3)), chain(steps)]))
    one, other = verified.pairs[np.diff(driven[verified.pairs], axis=1)[:, 0] <= FAR_M].T
    spans = np.bincount(one, minlength=len(driven)) - np.bincount(other, minlength=len(driven))
    return [int(step) for step in np.flatnonzero(np.cumsum(spans)[:-1] == 0)]


def _agreeing(poses: Array, verified: VerifiedPairs) -> Bools:
    """Which pairs (P,) have the motion that poses (R, 3) give them."""
    one, other = verified.pairs.T
    motions = between(poses[one], poses[other])
    ahead = np.arctan2(motions[:, 1], motions[:, 0])
    turns, directions = np.abs(wrap(motions[:, 2] - verified.turns)), np.abs(wrap(ahead - verified.directions))
    return (turns < AGREED_TURN) & (directions < AGREED_DIRECTION)
