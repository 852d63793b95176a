"""Time stamps of a log: which to keep so that they ascend, and poses at them."""

from array import array
from bisect import bisect_left
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from omninav.stages.geometry.arrays import Array, Bools
from omninav.stages.geometry.plane.se2 import interpolate

Stamps = npt.NDArray[np.int64]
TRUTH_MAX_GAP_S = 0.5
"""Largest time between an image and a true pose, seconds: an indoor robot drives half a metre in it at most."""
SAME_TIME_S = 0.001
"""Times of one moment differ by less than this, seconds: programs write them with six digits and more."""
LONE_S = 3600.0
"""A record further than this from all others of its kind tells of a broken clock, not of a drive."""


def max_step_s(times: Stamps, seconds: float, intervals: float) -> float:
    """Longest time (s) between two poses that is no gap: some seconds, or intervals as they usually are."""
    return max(seconds, intervals * float(np.median(np.diff(times))) / 1e9) if len(times) > 1 else seconds


def poses_at(times: Stamps, poses: Array, stamps: Stamps) -> Array:
    """Poses (N, 3) interpolated to stamps (ns); rows of NaN outside the range of `times`."""
    at = np.full((len(stamps), 3), np.nan)
    inside = within(stamps, times)
    first = times[0]  # differences are small enough for floats, nanoseconds since 1970 are not
    at[inside] = interpolate((times - first) / 1e9, poses, (stamps[inside] - first) / 1e9)
    return at


def poses_near(times: Stamps, poses: Array, stamps: Stamps, max_gap_s: float, begun: npt.ArrayLike = ()) -> Array:
    """Interpolates as `poses_at`, with NaN where the nearest of `times` is more than `max_gap_s` away, and over jumps.

    `begun` (J,): stamps (ns) at which the track starts again.

    The first and the last pose are also those of stamps that rounding alone puts before and after them.
    """
    ends = np.clip(stamps, times[0], times[-1])
    at = poses_at(times, poses, np.where(np.abs(stamps - ends) <= SAME_TIME_S * 1e9, ends, stamps))
    after = np.clip(np.searchsorted(times, stamps), 1, len(times) - 1)
    gap = np.minimum(np.abs(stamps - times[after - 1]), np.abs(times[after] - stamps))
    jumps = np.isin(after, np.searchsorted(times, begun)) & (times[after - 1] < stamps) & (stamps < times[after])
    at[jumps | (gap > max_gap_s * 1e9)] = np.nan
    return at


def ascending(stamps: Sequence[int]) -> tuple[list[int], list[int], list[int]]:
    """Which records to keep so that their stamps ascend: indices kept, repeated, and out of order.

    Of equal stamps the first is kept. Of the rest, the longest ascending sequence is kept: a single stamp that leaps
    ahead costs itself and not everything after it, and a clock that was set back costs the shorter part.
    """
    times = np.array(stamps, np.int64)
    kept = ascending_rows(times)
    lost = np.setdiff1d(np.arange(len(times)), kept)
    repeats = np.isin(lost, np.unique(times, return_index=True)[1], invert=True)
    return kept.tolist(), lost[repeats].tolist(), lost[~repeats].tolist()


def ascending_rows(stamps: Stamps) -> Stamps:
    """The records that `ascending` keeps of stamps (N,): (K,)."""
    firsts = np.sort(np.unique(stamps, return_index=True)[1])
    if (np.diff(stamps[firsts]) > 0).all():
        return firsts
    tails, ends, before = array("q"), array("q"), array("q")  # stamps that end the best sequences of each length
    for number, stamp in enumerate(stamps[firsts].data):  # as Python's own numbers
        length = bisect_left(tails, stamp)
        if length == len(tails):
            tails.append(stamp)
            ends.append(number)
        else:
            tails[length], ends[length] = stamp, number
        before.append(ends[length - 1] if length else -1)
    kept, at = array("q"), ends[-1]
    while at >= 0:
        kept.append(at)
        at = before[at]
    return firsts[np.array(kept[::-1], np.int64)]


def within(stamps: Stamps, times: Stamps) -> Bools:
    """Which stamps are in the range of `times`."""
    inside: Bools = (stamps >= times[0]) & (stamps <= times[-1])
    return inside


def lone(stamps: Stamps) -> Bools:
    """Which of ascending stamps (N,) in ns are more than `LONE_S` from all others: none where that is common."""
    if len(stamps) < 3:
        return np.zeros(len(stamps), np.bool_)
    far = np.concatenate([[True], np.diff(stamps) > LONE_S * 1e9, [True]])
    alone: Bools = far[:-1] & far[1:]
    return alone if 2 * alone.sum() < len(stamps) else np.zeros(len(stamps), np.bool_)
