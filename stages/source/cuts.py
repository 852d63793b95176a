"""A log whose middle is cut out: to the robot it is as if it were carried over that part."""

from collections.abc import Sequence

import numpy as np

from omninav.stages.geometry.arrays import Array, Bools, Ints
from omninav.stages.geometry.plane.se2 import between, compose
from omninav.stages.recordings.recording import UnreadableRecording

Cut = tuple[int, int]


def check_cuts(cuts: Sequence[Cut], frames: int, name: str) -> None:
    """Raise UnreadableRecording where a cut does not lead onwards within a log of a number of frames."""
    end = 0
    for after, to in cuts:
        if not end < after < to < frames:
            raise UnreadableRecording(
                f"{name}: the cut [{after}, {to}] does not lead onwards between {end} and {frames - 1}; type "
                "cuts=[[60,300]] to continue with image 300 once the first 60 are through"
            )
        end = to


def remaining_frames(cuts: Sequence[Cut], frames: int) -> Ints:
    """Numbers of the frames that are left."""
    kept = np.ones(frames, np.bool_)
    for after, to in cuts:
        kept[after:to] = False
    return np.flatnonzero(kept)


def thinned(frames: Ints, stamps: Ints, rate_hz: float | None) -> Ints:
    """The first of some frames in each period of 1 / `rate_hz` seconds, by the `stamps` (ns) of all; None: all.

    A tenth of a period early is on time, since clocks jitter. Where a clock was set back, periods begin again.
    """
    if rate_hz is None or not len(frames):
        return frames
    at = stamps[frames]
    begun = np.append(True, np.diff(at) <= 0)
    since = at - at[begun][np.cumsum(begun) - 1]
    periods = np.floor(since * (rate_hz / 1e9) + 0.1)
    first: Bools = begun | np.append(True, np.diff(periods) > 0)
    return frames[first]


def crossed(cuts: Sequence[Cut], frames: Ints) -> Bools:
    """Tells whether a cut is between each of the frames (N,) and the next: (N - 1,)."""
    done = np.searchsorted([to for _, to in cuts], frames, side="right")
    between_them: Bools = np.diff(done) > 0
    return between_them


def as_if_driven(poses: Array, cuts: Sequence[Cut]) -> Array:
    """Poses (N, 3) as odometry that does not know of the cuts gives them.

    What was measured on the way from image `to - 1` to image `to` is measured from the last one before the cut.
    """
    unaware = poses.copy()
    for after, to in cuts:
        moved = between(unaware[to - 1], unaware[to:])
        unaware[to:] = compose(unaware[after - 1], moved)
    return unaware
