"""Detects poses of a track that no robot can have, and jumps in it."""

import math
from array import array
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np

from omninav.pipeline import Bounds
from omninav.stages.geometry.arrays import Array, Bools, Ints
from omninav.stages.geometry.plane.se2 import between, chain, compose, wrap

from .stamps import Stamps

MIN_INTERVAL_S = 0.05
"""Stamps of a busy computer come in bunches: of two that are closer, this interval is judged."""
EXCURSION_S = 1.0
"""Longest excursion that is bridged, seconds; a track that stays away longer has started again."""
LOOK_BACK = 16
"""Stretches to which a track may be back."""
SILENCE_S, SILENT_INTERVALS = 1.0, 10.0
"""Odometry is silent between poses further apart than this (s), and than so many of its usual intervals."""
STOOD = 0.3
"""Motion over a silence (m, rad) below which it hides nothing: some drivers and localisers speak only while robots
move, AMCL by default every 0.25 m and 0.2 rad."""
MIN_STRETCH = 1.5
"""Poses that a stretch needs to be one: a pose alone tells of no motion."""


@dataclass(frozen=True)
class MotionLimits:
    """Largest speeds of a robot. Poses of odometry and ground truth that need more are not believed."""

    speed: Annotated[float, Bounds(gt=0)] = 15.0
    """Metres per second: a car in a town. A robot indoors makes 2, one outdoors seldom 5."""
    turn: Annotated[float, Bounds(gt=0)] = 4 * math.pi
    """Radians per second: two turns a second. A robot that spins on the spot makes one."""


class BelievedTrack(NamedTuple):
    """A track without what no robot does.

    `rows` (K,): which of the poses are believed. `jumps` (J,): those of `rows` (positions in it) that no motion leads
    to from the one before: the track starts again there. `gaps` (G, 2): stamps (ns) between which nothing that was
    measured is believed: about poses left out, and before jumps.
    """

    rows: Ints
    jumps: Ints
    gaps: Stamps


def believed(stamps: Stamps, poses: Array, limits: MotionLimits) -> BelievedTrack:
    """The part of a track (N,), (N, 3), in the order of its stamps, that a robot within `limits` can have driven.

    Where two poses in a row need a faster motion the track is split. Of its stretches those are kept that hold the most
    poses together: one follows another within `EXCURSION_S` where the robot can have come from its end, or it begins
    again, as a counter does that was reset, at the cost of as many poses as `EXCURSION_S` has. NaN is left out.
    """
    known = np.flatnonzero(np.isfinite(poses).all(axis=1))
    rows, jumps = _kept(stamps[known], poses[known], np.diff(known) > 1, limits)
    rows = known[rows]
    torn = np.diff(rows) > 1
    torn[jumps - 1] = True
    return BelievedTrack(rows, jumps, np.column_stack([stamps[rows[:-1][torn]], stamps[rows[1:][torn]]]))


def _kept(stamps: Stamps, poses: Array, torn: Bools, limits: MotionLimits) -> tuple[Ints, Ints]:
    """The longest chain of stretches by dynamic programming: its rows, and which of these start again.

    `torn` (N - 1,): where a pose between two is missing. There a stretch ends too, since more is possible.
    """
    splits = np.flatnonzero(torn | ~_possible(stamps[:-1], poses[:-1], stamps[1:], poses[1:], limits)) + 1
    nothing = np.empty(0, np.int64)
    if not len(splits):
        return np.arange(len(stamps)), nothing
    firsts, ends = np.append(0, splits), np.append(splits, len(stamps))
    resumes = [_resumes(firsts, ends, back, stamps, poses, limits).tobytes() for back in range(1, LOOK_BACK + 1)]
    cost = max(MIN_STRETCH, EXCURSION_S * 1e9 / float(np.median(np.diff(stamps))))
    score, before, jumped = array("d"), array("q"), bytearray()
    best = 0
    for number, length in enumerate((ends - firsts).data):
        most, link, jump = 0.0, -1, False
        if number and score[best] > cost:
            most, link, jump = score[best] - cost, best, True
        for back in range(1, min(LOOK_BACK, number) + 1):
            if score[number - back] > most and resumes[back - 1][number - back]:
                most, link, jump = score[number - back], number - back, False
        score.append(most + length)
        before.append(link)
        jumped.append(jump)
        best = number if score[number] > score[best] else best
    if score[best] < MIN_STRETCH:
        return nothing, nothing
    rows: list[Ints] = []
    begun: list[int] = []
    while best >= 0:
        rows.append(np.arange(firsts[best], ends[best]))
        begun += [int(firsts[best])] if jumped[best] else []
        best = before[best]
    kept = np.concatenate(rows[::-1])
    return kept, np.searchsorted(kept, np.array(begun[::-1], np.int64))


def without_jumps(stamps: Stamps, poses: Array, jumps: Ints) -> Array:
    """Poses (N, 3) as they would be had the track gone on: over each jump with the step from before it, at most.

    Of `believed`: before each jump are two poses or more.
    """
    if not len(jumps):
        return poses
    steps = between(poses[:-1], poses[1:])
    shares = (stamps[jumps] - stamps[jumps - 1]) / (stamps[jumps - 1] - stamps[jumps - 2])
    steps[jumps - 1] = steps[jumps - 2] * np.minimum(shares, 1.0)[:, None]
    return np.concatenate([poses[:1], compose(poses[0], chain(steps))])


def silent(stamps: Stamps, poses: Array, max_s: float) -> Bools:
    """Tells between which poses (N, 3) and the next ones, later than `max_s`, a robot moved unseen: (N - 1,)."""
    moved = np.abs(between(poses[:-1], poses[1:])).max(axis=1)
    nothing: Bools = (moved > STOOD) & (np.diff(stamps) > max_s * 1e9)
    return nothing


def squares_within(gaps: Stamps, stamps: Stamps) -> Array:
    """Squares (s^2) of the lengths of all `gaps` (G, 2) up to each of the stamps (N,), summed: (N,)."""
    before = np.append(0.0, np.cumsum(((gaps[:, 1] - gaps[:, 0]) / 1e9) ** 2))
    last = np.searchsorted(gaps[:, 0], stamps, side="right") - 1
    begun, ended = np.append(gaps, [[0, 0]], axis=0)[last].T
    within = np.where(last >= 0, np.minimum(stamps, ended) - begun, 0) / 1e9
    squares: Array = before[np.maximum(last, 0)] + within**2
    return squares


def possible_between(before: Array, after: Array, seconds: float, limits: MotionLimits) -> bool:
    """Tells whether a robot within `limits` gets from a pose (3,) to another in that time."""
    (x, y, heading), (x_then, y_then, heading_then) = after.tolist(), before.tolist()
    if not math.hypot(x - x_then, y - y_then) <= limits.speed * max(seconds, MIN_INTERVAL_S):  # nor is NaN
        return False
    return abs(math.remainder(heading - heading_then, 2 * math.pi)) <= limits.turn * max(seconds, MIN_INTERVAL_S)


def _resumes(firsts: Ints, ends: Ints, back: int, stamps: Stamps, poses: Array, limits: MotionLimits) -> Bools:
    """Tells whether a track can be at the first pose of a stretch, soon after the end of one before: (S - back,)."""
    last, first = ends[:-back] - 1, firsts[back:]
    possible = _possible(stamps[last], poses[last], stamps[first], poses[first], limits)
    return possible if back == 1 else possible & (stamps[first] - stamps[last] <= EXCURSION_S * 1e9)


def _possible(before: Stamps, start: Array, after: Stamps, end: Array, limits: MotionLimits) -> Bools:
    seconds = np.maximum((after - before) / 1e9, MIN_INTERVAL_S)
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows is too far
        near = np.hypot(end[:, 0] - start[:, 0], end[:, 1] - start[:, 1]) <= limits.speed * seconds
        possible: Bools = near & (np.abs(wrap(end[:, 2] - start[:, 2])) <= limits.turn * seconds)
    return possible
