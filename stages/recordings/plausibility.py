"""What no robot does: poses of a track that cannot be true, and jumps in it."""

import math
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds
from omninav.stages.geometry.plane.se2 import between, chain, compose, wrap

Array = npt.NDArray[np.float64]
Stamps = npt.NDArray[np.int64]
Rows = npt.NDArray[np.int64]
MIN_INTERVAL_S = 0.05
"""Stamps of a busy computer come in bunches: of two that are closer, this interval is judged."""
EXCURSION_S = 1.0
"""A track that is back after this time was never away; one that stays away longer has begun anew."""
LOOK_BACK = 8
"""Stretches to which a track may be back."""


@dataclass(frozen=True)
class MotionLimits:
    """What a robot can do at most. Poses of odometry and ground truth that need more are not believed."""

    speed: Annotated[float, Bounds(gt=0)] = 15.0
    """Metres per second: a car in a town. A robot indoors makes 2, one outdoors seldom 5."""
    turn: Annotated[float, Bounds(gt=0)] = 4 * math.pi
    """Radians per second: two turns a second. A robot that spins on the spot makes one."""


class BelievedTrack(NamedTuple):
    """A track without what no robot does.

    `rows` (K,): which of the poses are believed. `jumps` (J,): those of `rows` (positions in it) that no motion leads
    to from the one before: the track begins anew there. `gaps` (G, 2): stamps (ns) between which nothing that was
    measured is believed: about poses left out, and before jumps.
    """

    rows: Rows
    jumps: Rows
    gaps: Stamps


def believed(stamps: Stamps, poses: Array, limits: MotionLimits) -> BelievedTrack:
    """The part of a track (N,), (N, 3), in the order of its stamps, that a robot within `limits` can have driven.

    Where two poses in a row need a faster motion the track is split. A stretch that can go on where an earlier one
    ended up to `EXCURSION_S` ago does so, and what lies between is left out; other stretches begin anew, as a counter
    does that was reset. A pose alone that leads nowhere is left out, and so are poses of NaN.
    """
    splits = np.flatnonzero(~_possible(stamps[:-1], poses[:-1], stamps[1:], poses[1:], limits)) + 1
    none = np.empty((0, 2), np.int64)
    if not len(splits):
        return BelievedTrack(np.arange(len(stamps)), none[:, 0], none)
    ends = np.append(splits, len(stamps))
    chains: list[list[tuple[int, int]]] = []
    for first, end in zip(np.append(0, splits).tolist(), ends.tolist(), strict=True):
        back = next((n for n in range(1, LOOK_BACK + 1) if _resumes(chains, n, first, stamps, poses, limits)), 0)
        if back:
            del chains[len(chains) - back + 1 :]
            chains[-1].append((first, end))
        else:
            chains.append([(first, end)])
    chains = [chain for chain in chains if sum(end - first for first, end in chain) > 1]
    whole = [np.concatenate([np.arange(*stretch) for stretch in chain]) for chain in chains]
    rows = np.concatenate([np.empty(0, np.int64), *whole])
    jumps = np.cumsum([len(each) for each in whole], dtype=np.int64)[:-1]
    torn = np.diff(rows) > 1
    torn[jumps - 1] = True
    return BelievedTrack(rows, jumps, np.column_stack([stamps[rows[:-1][torn]], stamps[rows[1:][torn]]]))


def without_jumps(stamps: Stamps, poses: Array, jumps: Rows) -> Array:
    """Poses (N, 3) as they would be had the track gone on: over each jump with the step from before it, at most.

    Of `believed`: before each jump lie two poses or more.
    """
    if not len(jumps):
        return poses
    steps = between(poses[:-1], poses[1:])
    shares = (stamps[jumps] - stamps[jumps - 1]) / (stamps[jumps - 1] - stamps[jumps - 2])
    steps[jumps - 1] = steps[jumps - 2] * np.minimum(shares, 1.0)[:, None]
    return np.concatenate([poses[:1], compose(poses[0], chain(steps))])


def seconds_within(gaps: Stamps, stamps: Stamps) -> Array:
    """Seconds of all `gaps` (G, 2) up to each of the stamps (N,): (N,)."""
    lengths = np.append(0, np.cumsum(gaps[:, 1] - gaps[:, 0]))
    begun = np.searchsorted(gaps[:, 0], stamps, side="right")
    over = np.append(gaps[:, 1], 0)[begun - 1] - stamps
    inside: Array = (lengths[begun] - np.where(begun > 0, np.maximum(over, 0), 0)) / 1e9
    return inside


def _resumes(
    chains: list[list[tuple[int, int]]], back: int, row: int, stamps: Stamps, poses: Array, limits: MotionLimits
) -> bool:
    if back > len(chains):
        return False
    last = chains[-back][-1][1] - 1
    seconds = float(stamps[row] - stamps[last]) / 1e9
    if seconds > EXCURSION_S:
        return False
    (x, y, heading), (x_then, y_then, heading_then) = poses[row].tolist(), poses[last].tolist()
    if not math.hypot(x - x_then, y - y_then) <= limits.speed * max(seconds, MIN_INTERVAL_S):  # nor is NaN
        return False
    return abs(math.remainder(heading - heading_then, 2 * math.pi)) <= limits.turn * max(seconds, MIN_INTERVAL_S)


def _possible(before: Stamps, start: Array, after: Stamps, end: Array, limits: MotionLimits) -> npt.NDArray[np.bool_]:
    seconds = np.maximum((after - before) / 1e9, MIN_INTERVAL_S)
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows is too far
        near = np.hypot(end[:, 0] - start[:, 0], end[:, 1] - start[:, 1]) <= limits.speed * seconds
        possible: npt.NDArray[np.bool_] = near & (np.abs(wrap(end[:, 2] - start[:, 2])) <= limits.turn * seconds)
    return possible
