"""Relation of one track of poses to another of the same drive: as it is, turned, scaled or mirrored."""

import math
from typing import Literal, NamedTuple

import numpy as np

from omninav.stages.geometry.arrays import Array, Bools, Complex, Ints
from omninav.stages.geometry.plane.se2 import between, wrap

LAGS = (4, 8, 16, 32)
"""Steps between the two poses of a pair."""
MAX_OCTAVES, OCTAVE = 12.0, 0.5
"""Scales that are voted for, in factors of two, and the width of their bins: 1 m against 0.25 mm to 4 km."""
ANGLES = 18
"""Bins of the angle between tracks, 20 degrees each."""
NEAR_OCTAVES, NEAR_RAD = 0.5, math.radians(30.0)
"""Largest distance of a pair from a relation that it agrees with, octaves of scale and rad."""

PAIR_MOVED, PAIR_ALIKE = 2.0, 1.5
"""Length scales by which a pair must have moved to count, and within which two tracks agree on it."""


class TrackFit(NamedTuple):
    """The relation of tracks for which most pairs vote, and how many: `share` of the pairs that moved.

    The track becomes the other where its positions or the other's whole poses are `mirrored` (y to -y), it is turned by
    `angle` (rad, against its headings) and multiplied by `scale`. `as_is`: the share of pairs for which nothing has to
    be done. `pairs`: those that moved. `across`: the share of its pairs that lie across one and the same step, which
    may be a leap.
    """

    scale: float
    angle: float
    mirrored: Literal["", "positions", "poses"]
    share: float
    as_is: float
    pairs: int
    across: float


def track_fit(track: Array, other: Array, min_metres: float) -> TrackFit | None:
    """Relation of `track` (N, 3) to `other` (N, 3), each in a frame of its own; None where `other` does not move.

    Each pair of poses votes for the scale and angle that turn one displacement, seen from the first pose, into the
    other's; pairs count where `other` moved by more than `min_metres`. Wrong poses of `other` vote for anything, a leap
    spoils the pairs across it alone, and the rest agree: no more than a third of all need be right.
    """
    first, second = pairs_of(len(track))
    moved, there = displacements(other, first, second), displacements(track, first, second)
    kept = np.abs(moved) > min_metres
    if not kept.any():
        return None
    first, second, there = first[kept], second[kept], np.where(np.abs(there[kept]) < 1e-9, 1e-9, there[kept])
    seen, heading = moved[kept] * np.exp(-1j * other[first, 2]), np.exp(1j * track[first, 2])
    fits = [
        _fit(seen * heading / there, "", first, second),
        _fit(seen * heading / np.conj(there), "positions", first, second),
        _fit(np.conj(seen) * heading / there, "poses", first, second),
    ]
    best = max(fits, key=lambda fit: fit.share)  # the first of equals: a straight track is its own mirror image
    return best._replace(as_is=fits[0].as_is)


class Agreement(NamedTuple):
    """The `share` of `pairs` of poses with the same relative pose in two tracks."""

    share: float
    pairs: int


def agreement(track: Array, other: Array, length_scale_m: float) -> Agreement:
    """Counts the pairs of poses of `other` (N, 3) that are to each other as those of `track` (N, 3) are.

    Pairs count where `track` moved by two length scales; they agree within one and a half, turned by less than 30
    degrees. Matches that are drawn by chance agree in some hundredths.
    """
    first, second = pairs_of(len(track))
    moved = between(track[first], track[second])
    kept = np.hypot(*moved[:, :2].T) > PAIR_MOVED * length_scale_m
    moved = moved[kept]
    if not len(moved):
        return Agreement(0.0, 0)
    off = between(other[first[kept]], other[second[kept]]) - moved
    alike = (np.hypot(*off[:, :2].T) < PAIR_ALIKE * length_scale_m) & (np.abs(wrap(off[:, 2])) < NEAR_RAD)
    return Agreement(float(alike.mean()), len(moved))


def pairs_of(number: int) -> tuple[Ints, Ints]:
    """Indices of the first and second poses of all pairs that are `LAGS` apart."""
    lags = [lag for lag in LAGS if lag < number]
    first = np.concatenate([np.arange(number - lag) for lag in lags] or [np.zeros(0, np.int64)])
    second = np.concatenate([np.arange(lag, number) for lag in lags] or [np.zeros(0, np.int64)])
    return first, second


def displacements(track: Array, first: Ints, second: Ints) -> Complex:
    """From the first to the second poses, as complex numbers (m) in the track's frame."""
    points: Complex = track[:, 0] + 1j * track[:, 1]
    return points[second] - points[first]


def _fit(ratios: Complex, mirrored: Literal["", "positions", "poses"], first: Ints, second: Ints) -> TrackFit:
    octaves, angles = np.log2(np.abs(ratios) + 1e-12), np.angle(ratios)
    rows = 2 * int(MAX_OCTAVES / OCTAVE) + 1
    row = np.clip(np.round((octaves + MAX_OCTAVES) / OCTAVE), 0, rows - 1).astype(np.int64)
    column = np.round(angles / (2.0 * math.pi) * ANGLES).astype(np.int64) % ANGLES
    votes = np.bincount(row * ANGLES + column, minlength=rows * ANGLES).reshape(rows, ANGLES)
    around = votes + np.roll(votes, 1, axis=1) + np.roll(votes, -1, axis=1)
    around[1:-1] = around[:-2] + around[1:-1] + around[2:]
    votes = around * (len(ratios) + 1) + votes  # of bins with as many around them, the one that holds most
    at = np.unravel_index(int(votes.argmax()), votes.shape)
    octave, angle = float(at[0]) * OCTAVE - MAX_OCTAVES, float(at[1]) / ANGLES * 2.0 * math.pi
    for _ in range(2):  # to the middle of its votes
        near = _agrees(octaves, angles, octave, angle)
        if not near.any():
            break
        octave = float(np.median(octaves[near]))
        angle = float(wrap(angle + np.median(wrap(angles[near] - angle))))
    near = _agrees(octaves, angles, octave, angle)
    as_is = _agrees(octaves, angles, 0.0, 0.0)
    begun, ended = (np.bincount(ends[near], minlength=int(second.max()) + 1) for ends in (first, second))
    across = float(np.cumsum(begun - ended).max()) / max(int(near.sum()), 1)
    return TrackFit(2.0**octave, angle, mirrored, float(near.mean()), float(as_is.mean()), len(ratios), across)


def _agrees(octaves: Array, angles: Array, octave: float, angle: float) -> Bools:
    return (np.abs(octaves - octave) < NEAR_OCTAVES) & (np.abs(wrap(angles - angle)) < NEAR_RAD)
