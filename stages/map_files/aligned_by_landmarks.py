"""Maps without a common frame, brought into one by the landmarks that are in several of them."""

import math
from collections.abc import Sequence

import numpy as np

from omninav.stages.geometry.appearance.feature_matching import mutual_nearest_units
from omninav.stages.geometry.arrays import Array, Floats, Ints
from omninav.stages.geometry.plane.se2 import compose
from omninav.stages.values.landmarks import Landmarks, mirrored_alike, restored_descriptors
from omninav.stages.values.maps import ReferenceGraph

from .aligned import Alignment

MAX_COMPARED = 8_000
"""Landmarks of a map that are compared, evenly spaced: among these, two maps share enough."""
RATIO = 0.8
"""Largest ratio of a match's distance to that of the second nearest elsewhere."""
TOLERANCE_M = 0.15
"""Distance within which two landmarks are one: far ones are not known better, and maps are bent."""
SAMPLES, ROUNDS = 1000, 5
"""Pairs of matches from which a motion is computed, and rounds of least squares on those that agree with the best."""
MIN_AGREEING = 50
"""Landmarks that must agree on the motion between two maps: of two houses at most a few do by chance."""


def aligned_by_landmarks(maps: Sequence[ReferenceGraph], rng: np.random.Generator) -> Alignment | None:
    """Poses of the references of all maps in the frame of the first; None where landmarks do not join all.

    Each map is moved as a whole, by the motion on a floor that most of the landmarks agree on that look alike; maps are
    joined in the order of how many these are. Draws from `rng`.
    """
    given = [map.landmarks for map in maps if map.landmarks is not None]
    if len(given) < len(maps):
        return None
    points, looks = zip(*map(_compared, mirrored_alike(given)), strict=True)
    motions: dict[int, Array] = {0: np.zeros(3)}
    tried: dict[tuple[int, int], tuple[int, Array]] = {}
    agreeing = 0
    while len(motions) < len(maps):
        for one in motions:
            for other in set(range(len(maps))) - set(motions):
                if (one, other) not in tried:
                    pairs = _pairs(looks[one], looks[other], points[one], points[other])
                    tried[one, other] = _motion(points[one][pairs[:, 0]], points[other][pairs[:, 1]], rng)
        number, one, other = max((tried[a, b][0], a, b) for a, b in tried if b not in motions)
        if number < MIN_AGREEING:
            return None
        motions[other] = compose(motions[one], tried[one, other][1])
        agreeing += number
    poses = [compose(motions[n], map.poses) for n, map in enumerate(maps)]
    return Alignment(np.concatenate(poses), agreeing, (True,) * len(maps))


def _compared(landmarks: Landmarks) -> tuple[Array, Floats]:
    rows = np.linspace(0, max(len(landmarks) - 1, 0), min(len(landmarks), MAX_COMPARED)).astype(np.int64)
    return landmarks.points[rows].astype(np.float64), restored_descriptors(landmarks.descriptors[rows])


def _pairs(looks: Floats, other_looks: Floats, points: Array, others: Array) -> Ints:
    """Rows (M, 2) of landmarks that look alike; either map may hold a point twice, as one that was joined does."""
    there = mutual_nearest_units(looks, other_looks, RATIO, others)
    back = mutual_nearest_units(other_looks, looks, RATIO, points)
    both = np.concatenate([np.stack([there.first, there.second]), np.stack([back.second, back.first])], axis=1)
    return np.asarray(np.unique(both.T, axis=0), np.int64)


def _motion(points: Array, others: Array, rng: np.random.Generator) -> tuple[int, Array]:
    """Finds the motion (3,) of the others' frame on which most matched points (M, 3) agree, and how many do."""
    level = np.abs(points[:, 2] - others[:, 2]) < TOLERANCE_M
    a, b = points[level, :2] @ [1.0, 1j], others[level, :2] @ [1.0, 1j]
    if len(a) < MIN_AGREEING:
        return 0, np.zeros(3)
    one, other = rng.integers(0, len(a), (2, SAMPLES))
    there, here = a[other] - a[one], b[other] - b[one]
    usable = (np.abs(there) > 10.0 * TOLERANCE_M) & (np.abs(np.abs(there) - np.abs(here)) < TOLERANCE_M)
    turns = np.exp(1j * np.angle(there[usable] * here[usable].conj()))
    shifts = a[one[usable]] - turns * b[one[usable]]
    agree = [int((np.abs(turn * b + shift - a) < TOLERANCE_M).sum()) for turn, shift in zip(turns, shifts, strict=True)]
    if not agree:
        return 0, np.zeros(3)
    turn, shift = turns[np.argmax(agree)], shifts[np.argmax(agree)]
    for _ in range(ROUNDS):
        near = np.abs(turn * b + shift - a) < TOLERANCE_M
        centre, own = a[near].mean(), b[near].mean()
        turn = np.exp(1j * np.angle(((a[near] - centre) * (b[near] - own).conj()).sum()))
        shift = centre - turn * own
    return int(near.sum()), np.array([shift.real, shift.imag, math.atan2(turn.imag, turn.real)])
