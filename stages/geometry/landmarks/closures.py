"""Loop closures by words and geometry: a drive that odometry alone has bent, straightened by what its images share."""

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from omninav.stages.geometry.arrays import Array, Floats, Ints
from omninav.stages.geometry.plane.pose_graph import optimised_poses
from omninav.stages.geometry.plane.se2 import compose
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
LENGTH_SIGMA, LENGTH_SIGMA_M = 0.1, 0.05
"""Standard deviation of where the second reference of a pair lies: a part of its distance, and m."""
UNKNOWN_M = 2.0
"""The same where its distance is not known, m."""


class VerifiedPairs(NamedTuple):
    """Pairs of references and the motion between them, its length aside, and the matches that agree with it.

    `pairs` (P, 2), the earlier first; `turns` (P,): heading of the later in the frame of the earlier, and `directions`
    (P,): where it lies in that frame (rad). `first`, `second` (M,): matched rows of features, of all pairs, with
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


def straightened_drive(first: Array, steps: Array, sigmas: Array, verified: VerifiedPairs, lengths: Array) -> Array:
    """Poses (R, 3) of one drive that agree best with its odometry and with the motions of verified pairs.

    `first` (3,): the first pose; `steps` (R - 1, 3): motions from each to the next, with standard deviations `sigmas`
    (R - 1, 3); `lengths` (P,) of the pairs' motions, m, NaN where they are not known. A pose graph with Cauchy's loss
    on the pairs.
    """
    poses = np.concatenate([first[None], np.empty_like(steps)])
    for row, step in enumerate(steps):
        poses[row + 1] = compose(poses[row], step)
    known = np.isfinite(lengths)
    distances = np.where(known, lengths, 0.0)
    towards = distances * np.stack([np.cos(verified.directions), np.sin(verified.directions)])
    spreads = np.where(known, LENGTH_SIGMA_M + LENGTH_SIGMA * distances, UNKNOWN_M)
    along = np.arange(len(steps))
    return optimised_poses(
        poses,
        np.concatenate([np.column_stack([along, along + 1]), verified.pairs]),
        np.concatenate([steps, np.column_stack([*towards, verified.turns])]),
        np.concatenate([sigmas, np.column_stack([spreads, spreads, np.full(len(spreads), TURN_SIGMA)])]),
        np.arange(len(steps) + len(spreads)) >= len(steps),
    )[0]
