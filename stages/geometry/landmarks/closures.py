"""Loop closures by words and geometry: a drive that odometry alone has bent, straightened by what its images share."""

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from omninav.stages.geometry.arrays import Array, Bools, Floats, Ints
from omninav.stages.geometry.plane.pose_graph import optimised_poses
from omninav.stages.geometry.plane.se2 import between, chain, compose, wrap
from omninav.stages.geometry.two_views.relative_pose_ransac import false_alarms, relative_pose

from .map_making import LocalViews, pair_matches

CANDIDATES, FAR_CANDIDATES = 8, 5
"""References that each is compared with: the most similar of all, and the most similar of those far along the drive."""
FAR_M = 3.0
"""Way (m) along the drive beyond which two references are far from each other: what they share closes a loop."""
TOLERANCE = math.radians(0.4)
"""Angle by which a bearing may miss the epipolar plane (rad)."""
MAX_SAMPLES = 300
"""Samples of the relative pose at most: with fewer right matches than that finds there are too few anyway."""
MIN_INLIERS = 12
"""Matches that must agree on a motion: in a house 38 % of the motions of 8 to 11 matches were wrong, of more 0.8 %."""
MAX_FALSE_ALARMS = 1e-6
"""Expected number of motions that as many matches agree on by chance, at most."""
TURN_SIGMA = math.radians(0.5)
"""Standard deviation of a pair's turn (rad)."""
DISTANCE_SIGMAS_M = (2.0, 0.3, 0.3)
"""Standard deviations (m) of where the second reference of a pair is, round by round: the first does not know how far
away it is, the next have the distance of the round before."""
MAX_DISTANCE_M = 4.0
"""Distance of a pair, m, beyond which it is not believed."""
CARRIED_SIGMAS = (100.0, 100.0, math.pi)
"""Standard deviations (m, m, rad) of a motion in which the robot was carried."""
CARRIED_M, CARRIED_RAD = 0.5, math.radians(20.0)
"""Smallest difference from odometry that tells that the robot was carried: distance (m) and turn (rad)."""
MISS_M, ROUNDS = 0.5, 10
"""Distance of a place from where a pair sees it at which the pair counts by half (m), and rounds of weighing pairs."""
UNSEEN_M = 0.5
"""Distance by odometry within which two consecutive images should share something, m."""
MAX_DOUBTFUL = 10
"""Largest number of steps of a drive in which the robot may have been carried: with more its images show too little."""
MIN_DISAGREEING = 6
"""Smallest number of pairs that must cease to disagree once the robot was carried in a step, and by which fewer must be
left than with any other step."""
AGREED_TURN, AGREED_DIRECTION = math.radians(2.0), math.radians(15.0)
"""Largest differences from poses of a pair that agrees with them: of its turn and its direction (rad)."""


class VerifiedPairs(NamedTuple):
    """Pairs of references and the motion between them, its length aside, and the matches that agree with it.

    `pairs` (P, 2), the earlier first; `turns` (P,): heading of the later in the frame of the earlier, and `directions`
    (P,): where it is in that frame (rad). `first`, `second` (M,): matched rows of features, of all pairs, with
    `ratio` (M,): the clearer, the smaller; `owners` (M,): the pair of each.
    """

    pairs: Ints
    turns: Array
    directions: Array
    first: Ints
    second: Ints
    ratio: Array
    owners: Ints


def candidate_pairs(similarities: Iterable[Floats], driven: Array) -> Ints:
    """Pairs (P, 2) of references to compare, each once, the earlier first.

    `similarities`: row r is that of reference r to all (R,), by visual words; `driven` (R,): metres along the drive.
    Each with its predecessor, with the most similar ones, and with the most similar ones that are far along the drive.
    """
    pairs = {(one - 1, one) for one in range(1, len(driven))}
    for one, row in enumerate(similarities):
        others = np.argsort(-row, kind="stable")
        others = others[others != one]
        far = others[np.abs(driven[others] - driven[one]) > FAR_M]
        for other in (*others[:CANDIDATES].tolist(), *far[:FAR_CANDIDATES].tolist()):
            pairs.add((min(one, other), max(one, other)))
    return np.array(sorted(pairs), np.int64).reshape(-1, 2)


def verified_pairs(views: LocalViews, pairs: Ints, rng: np.random.Generator) -> VerifiedPairs:
    """Those of the pairs (P, 2) of which enough local features agree on one motion of a robot on a floor.

    Draws from `rng`.
    """
    kept, turns, directions, right = [], [], [], [np.empty(0, np.int64)]
    matches = pair_matches(views, pairs)
    for n, pair in enumerate(pairs.tolist()):
        rows = np.arange(matches.starts[n], matches.starts[n + 1])
        if len(rows) < MIN_INLIERS:
            continue
        first, second = views.bearings[matches.first[rows]], views.bearings[matches.second[rows]]
        pose = relative_pose(first, second, rng, threshold=TOLERANCE, max_samples=MAX_SAMPLES)
        if pose is None or np.count_nonzero(pose.inliers) < MIN_INLIERS:
            continue
        if false_alarms(pose, first, second, TOLERANCE) > MAX_FALSE_ALARMS:
            continue
        kept.append(pair)
        turns.append(math.atan2(pose.rotation[1, 0], pose.rotation[0, 0]))
        directions.append(math.atan2(pose.translation[1], pose.translation[0]))
        right.append(rows[pose.inliers])
    owners = np.repeat(np.arange(len(kept)), [len(rows) for rows in right[1:]])
    those = np.concatenate(right)
    return VerifiedPairs(
        np.array(kept, np.int64).reshape(-1, 2),
        np.array(turns, np.float64),
        np.array(directions, np.float64),
        matches.first[those],
        matches.second[those],
        matches.ratio[those],
        owners,
    )


def straightened_drive(
    first: Array, steps: Array, sigmas: Array, verified: VerifiedPairs, is_near: bool = False
) -> Array:
    """Poses (R, 3) of one drive that agree best with its odometry and with the motions of verified pairs.

    `first` (3,): the first pose; `steps` (R - 1, 3): motions from each to the next, with standard deviations `sigmas`
    (R - 1, 3). A pose graph with Cauchy's loss on the pairs. How long a pair's motion is, the poses of the round before
    say: across its direction it is measured, along it each round confirms the last. `is_near`: the steps themselves say
    it well enough for the first round.
    """
    poses = np.concatenate([first[None], compose(first, chain(steps))])
    along = np.column_stack([np.arange(len(steps)), np.arange(1, len(poses))])
    edges, pairs = np.concatenate([along, verified.pairs]), len(verified.pairs)
    distances = _distances(poses, verified) if is_near else np.zeros(pairs)
    for sigma in DISTANCE_SIGMAS_M:
        towards = distances * np.stack([np.cos(verified.directions), np.sin(verified.directions)])
        poses, _ = optimised_poses(
            poses,
            edges,
            np.concatenate([steps, np.column_stack([*towards, verified.turns])]),
            np.concatenate([sigmas, np.tile([sigma, sigma, TURN_SIGMA], (pairs, 1))]),
            np.arange(len(edges)) >= len(along),
        )
        distances = _distances(poses, verified)
    return poses


def _distances(poses: Array, verified: VerifiedPairs) -> Array:
    one, other = verified.pairs.T
    distances: Array = np.hypot(*(poses[other] - poses[one])[:, :2].T)
    return np.minimum(distances, MAX_DISTANCE_M)


class CarriedDrive(NamedTuple):
    """Motions (R - 1, 3) of a drive and their standard deviations, and the steps (S,) in which the robot was carried,
    whose motions are those that the closures show. `unseen` (U,): short steps by odometry without a near pair, though
    neither they nor their contrary can be shown."""

    motions: Array
    sigmas: Array
    steps: Ints
    unseen: Ints


def carried_drive(poses: Array, steps: Array, sigmas: Array, verified: VerifiedPairs) -> CarriedDrive:
    """Finds the steps of a drive in which the robot was carried, as while its recording paused.

    `poses` (R, 3): the drive straightened by `straightened_drive` of the same `steps`, `sigmas` and `verified`. No near
    pair spans such a step, and with the motion that closures give it, which is not odometry's, at most half of the
    pairs disagree that span it and did so before. Where another step explains the closures as well nobody knows.
    """
    doubtful = _unspanned(steps, verified)
    short = [step for step in doubtful if math.hypot(steps[step, 0], steps[step, 1]) < UNSEEN_M]
    found = same = CarriedDrive(steps, sigmas, np.empty(0, np.int64), np.array(short, np.int64))
    disagreeing, is_clear = ~_agreeing(poses, verified), True
    while 0 < len(doubtful) <= MAX_DOUBTFUL:
        tried = [_carried(poses[0], found, step, verified) for step in doubtful]
        freed = [straightened_drive(poses[0], *each[:2], verified, is_near=True) for each in tried]
        wrong = [~_agreeing(each, verified) for each in freed]
        left = np.array([np.count_nonzero(each) for each in wrong])
        best = int(np.argmin(left))
        step = doubtful.pop(best)
        off = tried[best].motions[step] - steps[step]
        moved = math.hypot(off[0], off[1]) > CARRIED_M or abs(float(wrap(off[2]))) > CARRIED_RAD
        doubted = disagreeing & _spanning(step, verified)
        fewer = np.count_nonzero(doubted) - np.count_nonzero(doubted & wrong[best])
        if not moved or fewer < max(MIN_DISAGREEING, np.count_nonzero(doubted) / 2):
            break
        is_clear = bool((np.delete(left, best) - left[best] >= MIN_DISAGREEING).all())
        disagreeing, found = wrong[best], tried[best]
    if not is_clear:
        return same
    return found._replace(unseen=np.setdiff1d(found.unseen, found.steps))


def _spanning(step: int, verified: VerifiedPairs) -> Bools:
    return (verified.pairs[:, 0] <= step) & (verified.pairs[:, 1] > step)


def _carried(first: Array, drive: CarriedDrive, step: int, verified: VerifiedPairs) -> CarriedDrive:
    """The drive with another motion in a step: that with which most of the pairs agree that span it."""
    poses = np.concatenate([first[None], compose(first, chain(drive.motions))])
    spanning = _spanning(step, verified)
    motions, sigmas = drive.motions.copy(), drive.sigmas.copy()
    sigmas[step] = CARRIED_SIGMAS
    if np.count_nonzero(spanning) >= MIN_DISAGREEING:
        one, other = verified.pairs[spanning].T
        start, then = poses[step], poses[step + 1]
        turns = poses[one, 2] + verified.turns[spanning] - poses[other, 2]
        near = np.abs(wrap(turns[:, None] - turns)) < AGREED_DIRECTION
        turn = turns[np.argmax(near.sum(axis=1))]
        agreeing = np.abs(wrap(turns - turn)) < AGREED_DIRECTION
        one, other, towards = one[agreeing], other[agreeing], (poses[one, 2] + verified.directions[spanning])[agreeing]
        ends = compose(np.array([*then[:2], then[2] + turn]), between(then, poses[other]))
        across = np.column_stack([-np.sin(towards), np.cos(towards)])
        missing = np.einsum("pi,pi->p", across, poses[one, :2] - ends[:, :2])
        by, weights = np.zeros(2), np.ones(len(missing))
        for _ in range(ROUNDS):
            by = np.linalg.lstsq(across * weights[:, None], missing * weights, rcond=None)[0]
            weights = 1.0 / np.sqrt(1.0 + ((across @ by - missing) / MISS_M) ** 2)
        motions[step] = between(start, np.array([*(then[:2] + by), then[2] + turn]))
    return CarriedDrive(motions, sigmas, np.sort(np.append(drive.steps, step)), drive.unseen)


def _unspanned(steps: Array, verified: VerifiedPairs) -> list[int]:
    """Steps of a drive that no pair of references near to each other along it spans."""
    driven = np.concatenate([[0.0], np.cumsum(np.hypot(steps[:, 0], steps[:, 1]))])
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
