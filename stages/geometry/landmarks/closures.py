"""Loop closures by words and geometry: a drive that odometry alone has bent, straightened by what its images share."""

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from omninav.stages.geometry.arrays import Array, Floats, Ints
from omninav.stages.geometry.plane.pose_graph import optimised_poses
from omninav.stages.geometry.plane.se2 import chain, compose
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
