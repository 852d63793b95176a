"""Lengths of the motions between pairs of images, by the depths of the features that pairs have in common."""

import math
from typing import NamedTuple

import numpy as np

from omninav.stages.geometry.arrays import Array, Ints
from omninav.stages.geometry.plane.se2 import distances_along, turned
from omninav.stages.geometry.two_views.triangulation import angles_between, closest

from .closures import FAR_M, TURN_SIGMA, VerifiedPairs

MIN_PARALLAX = math.radians(0.7)
"""Smallest angle between the bearings of a match whose depth counts (rad)."""
MIN_COMMON, MAX_NEXT = 3, 11
"""Smallest number of features in common with which two pairs are compared, and largest number of next ones with which a
pair of a feature is."""
DEPTH_SIGMA = 0.15
"""Standard deviation of the logarithm of a ratio of two depths."""
ODOMETRY_SIGMA, ODOMETRY_SIGMA_M = 0.2, 0.01
"""Standard deviation of a length by odometry, a part of it, and m: pairs that overlap share their errors."""
MIN_LENGTH_M = 0.05
"""Smallest length by odometry that counts, m."""
COMPARED, MIN_SLIP, MIN_SLIP_M = 5, 0.12, 0.1
"""Motions over which lengths are compared; and smallest difference that tells that wheels slipped: a part of the
greater length (in a house without slip it is at most 0.08), and m, as images may be late."""
MAX_USUAL = 0.06
"""Median of such differences above which odometry and images have other lengths everywhere, as where the camera's mount
is not known yet: then none tells anything."""
ARM_M = 0.2
"""Distance from the robot's axis, m, that a camera may have beside its described mount, so that turns move it."""
LENGTH_SIGMA, LENGTH_SIGMA_M = 0.1, 0.05
"""Standard deviation of a length by images: a part of it, and m."""
MAX_LOGARITHM, RESOLUTION = 10.0, 1e-5
"""Largest logarithm of a ratio of depths, for which larger ones count, and the steps to which it is rounded."""
FIRST_SCALE, LAST_SCALE, ROUNDS = 100.0, 1.0, 15
"""Standard deviations at which what disagrees counts by half (Cauchy), at first and in the last of the rounds."""
FREE = 1e3
"""Standard deviation of the logarithm of a length of which nothing is known."""


class Steps(NamedTuple):
    """Motions (R - 1, 3) of a drive from reference to reference, with their standard deviations (R - 1, 3).

    `slipped` (S,): those for which odometry has another length than the images show; their motion is what these show.
    """

    motions: Array
    sigmas: Array
    slipped: Ints


def pair_lengths(bearings: Array, pairs: VerifiedPairs, odometry: Array) -> Array:
    """Lengths (P,), m, of the motions of verified pairs; NaN where nothing tells.

    `bearings` (N, 3): of all features; `odometry` (R, 3): poses of the references, wrong where wheels slipped. A match
    has its depth in lengths of the pair's motion, so that a feature of two pairs gives the ratio of their lengths. Most
    of odometry's lengths and these ratios agree: least squares of logarithms with Cauchy's loss. Where wheels slipped
    over half of the pairs that ratios link, as of one room, lengths are wrong.
    """
    from scipy import sparse  # slow to import, and seldom needed
    from scipy.sparse.csgraph import connected_components
    from scipy.sparse.linalg import splu

    measured = _measured(pairs, odometry)
    one, other, ratios, sigmas = _ratios(bearings, pairs)
    known, number = np.flatnonzero(np.isfinite(measured)), len(measured)
    weights = 1.0 / np.concatenate([sigmas, ODOMETRY_SIGMA + ODOMETRY_SIGMA_M / measured[known]])
    links, signs = np.arange(len(one)), np.repeat([-1.0, 1.0], [len(one), len(one) + len(known)])
    rows = np.concatenate([links, links, len(one) + np.arange(len(known))])
    columns = np.concatenate([one, other, known])
    slopes = sparse.csr_array((signs * weights[rows], (rows, columns)), shape=(len(weights), number))
    right = np.concatenate([ratios, np.log(measured[known])]) * weights
    lengths, trusted = np.zeros(number), np.ones(len(right))
    for scale in np.geomspace(FIRST_SCALE, LAST_SCALE, ROUNDS):
        weighted = slopes.T * trusted
        normal = (weighted @ slopes + FREE**-2 * sparse.eye_array(number)).tocsc()
        lengths = splu(normal, permc_spec="MMD_AT_PLUS_A").solve(weighted @ right)
        trusted = 1.0 / (1.0 + ((slopes @ lengths - right) / scale) ** 2)
    # Pairs that ratios link have one factor in common, which odometry must tell.
    _, groups = connected_components(sparse.csr_array((np.ones(len(one)), (one, other)), shape=(number, number)))
    told = np.bincount(groups, np.isfinite(measured)) > 0.0
    return np.where(told[groups], np.exp(lengths), np.nan)


def driven_steps(steps: Array, sigmas: Array, pairs: VerifiedPairs, lengths: Array) -> Steps:
    """Motions from reference to reference by odometry, `steps` (R - 1, 3), and by the images where wheels slipped.

    `sigmas` (R - 1, 3): standard deviations of odometry; `lengths` (P,): of the pairs.
    """
    next_to = np.flatnonzero((np.diff(pairs.pairs, axis=1)[:, 0] == 1) & np.isfinite(lengths))
    next_to = next_to[np.argsort(pairs.pairs[next_to, 0])]
    rows, length = pairs.pairs[next_to, 0], lengths[next_to]
    if len(rows) < COMPARED:
        return Steps(steps, sigmas, np.empty(0, np.int64))
    compared = np.column_stack([length, np.hypot(steps[rows, 0], steps[rows, 1]), ARM_M * np.abs(steps[rows, 2])])
    seen, driven, swung = (np.convolve(each, np.ones(COMPARED), "valid") for each in compared.T)
    off, greater = np.abs(seen - driven), np.maximum(seen, driven)
    slips = off > np.maximum(MIN_SLIP * greater, MIN_SLIP_M) + swung
    slips &= np.median(off / np.maximum(greater, MIN_LENGTH_M)) < MAX_USUAL
    wrong = np.convolve(slips, np.ones(COMPARED)) > 0.0
    rows, length, direction = rows[wrong], length[wrong], pairs.directions[next_to[wrong]]
    motions, spreads = steps.copy(), sigmas.copy()
    motions[rows] = np.column_stack(
        [length * np.cos(direction), length * np.sin(direction), pairs.turns[next_to[wrong]]]
    )
    spreads[rows, :2] = LENGTH_SIGMA_M + LENGTH_SIGMA * length[:, None]
    spreads[rows, 2] = TURN_SIGMA
    return Steps(motions, spreads, rows)


def _measured(pairs: VerifiedPairs, odometry: Array) -> Array:
    """Lengths (P,) of the pairs by odometry, m; NaN where these are too short, or span too much of the drive."""
    one, other = pairs.pairs.T
    driven = distances_along(odometry)
    lengths = np.hypot(*(odometry[other] - odometry[one])[:, :2].T)
    return np.where((driven[other] - driven[one] < FAR_M) & (lengths > MIN_LENGTH_M), lengths, np.nan)


def _ratios(bearings: Array, pairs: VerifiedPairs) -> tuple[Ints, Ints, Array, Array]:
    """Pairs that have features in common, one and the other (C,), the logarithm of the other's length over the one's
    (C,), and its standard deviation (C,)."""
    here, there = _depths(bearings, pairs)
    features, depths = np.concatenate([pairs.first, pairs.second]), np.concatenate([here, there])
    owners = np.concatenate([pairs.owners, pairs.owners])
    order = np.lexsort((owners, features))
    order = order[np.isfinite(depths[order])]
    features, depths, owners = features[order], np.log(depths[order]), owners[order]
    keys, values = [], []
    for later in range(1, MAX_NEXT + 1):
        same = features[later:] == features[:-later]
        keys.append((owners[:-later] * len(pairs.pairs) + owners[later:])[same])
        values.append((depths[:-later] - depths[later:])[same])
    key, value = np.concatenate(keys), np.concatenate(values)
    key, starts, value, counts = _grouped(key, value)
    median = value[starts + counts // 2]
    _, _, off, _ = _grouped(np.repeat(key, counts), np.abs(value - np.repeat(median, counts)))
    spread = 1.25 * np.maximum(1.4826 * off[starts + counts // 2], DEPTH_SIGMA)
    enough = counts >= MIN_COMMON
    one, other = np.divmod(key[enough], len(pairs.pairs))
    return one, other, median[enough], (spread / np.sqrt(counts))[enough]


def _depths(bearings: Array, pairs: VerifiedPairs) -> tuple[Array, Array]:
    """Distances (M,) of matched features from the first image and from the second, in lengths of the pair's motion; NaN
    where they have too little parallax or would be behind."""
    turns, directions = pairs.turns[pairs.owners], pairs.directions[pairs.owners]
    first, second = bearings[pairs.first], turned(bearings[pairs.second], turns)
    towards = np.column_stack([np.cos(directions), np.sin(directions), np.zeros(len(directions))])
    along = (np.einsum("mi,mi->m", each, towards) for each in (first, second))
    here, there = closest(first, second, *along)
    tells = (angles_between(first, second) > MIN_PARALLAX) & (here > 0.0) & (there > 0.0)
    return np.where(tells, here, np.nan), np.where(tells, there, np.nan)


def _grouped(keys: Ints, values: Array) -> tuple[Ints, Ints, Array, Ints]:
    """The different keys, where each one's values start, the values (N,), sorted by key and size, and their numbers."""
    span = round(2.0 * MAX_LOGARITHM / RESOLUTION) + 1
    steps = np.rint((np.clip(values, -MAX_LOGARITHM, MAX_LOGARITHM) + MAX_LOGARITHM) / RESOLUTION).astype(np.int64)
    both = np.sort(keys * span + steps)  # one array sorts ten times as fast as two
    keys, ordered = both // span, np.asarray(both % span * RESOLUTION - MAX_LOGARITHM)
    starts = np.flatnonzero(np.diff(keys, prepend=-1)).astype(np.int64)
    return keys[starts], starts, ordered, np.diff(starts, append=len(keys))
