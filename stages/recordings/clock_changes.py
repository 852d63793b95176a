"""Clocks that were set while a log was recorded, by the times at which its messages were recorded."""

from collections.abc import Sequence

import numpy as np

from omninav.pipeline.mcap.message import Record
from omninav.stages.geometry.arrays import Array

from .stamps import Stamps

SET_BACK_S = 10.0
"""Time by which a record is earlier than those before it in the file where the clock was set back, s."""
MIN_STEP_S = 0.5
"""Smallest change of the camera's clock that is reported, s: a robot drives half a metre and less in that time."""
NEIGHBOURS, MIN_NEIGHBOURS = 10, 5
"""Images before and after such a change over whose delays the medians are taken, and how many there must be."""
MAX_PAUSE = 3.0
"""Longest pause at such a change, in usual times between images: longer ones leave queued images behind them."""


def set_back(records: Sequence[Record]) -> str:
    """Sentence on a clock that was set back while a file was recorded, by the order of its records; else ""."""
    times = np.array([record.log_time for record in records], dtype=np.int64)
    steps = np.diff(times)
    if not len(steps) or steps.min() > -SET_BACK_S * 1e9:
        return ""
    at = int(steps.argmin())
    return (
        f"the clock was set back by {-steps[at] / 1e9:.0f} s after image {at + 1}; images are taken in the order of "
        "their stamps"
    )


def camera_clock_set(images: Stamps, odometry: Stamps) -> str:
    """Sentence on stamps of images that change against those of odometry from one image to the next; else "".

    `images` (N, 2), `odometry` (M, 2): stamps and log times (ns). Between two images that were recorded one after the
    other as usual, stamps go on by another time; the delay of recording changes with it and stays, and odometry's does
    not.
    """
    images = images[np.argsort(images[:, 1], kind="stable")]
    steps = np.diff(images, axis=0) / 1e9
    if len(steps) < 2 * MIN_NEIGHBOURS:
        return ""
    changes = steps[:, 0] - steps[:, 1]
    changes[steps[:, 1] > MAX_PAUSE * np.median(steps[:, 1])] = 0.0
    changes[: MIN_NEIGHBOURS - 1] = changes[len(steps) - MIN_NEIGHBOURS + 1 :] = 0.0
    at = int(np.abs(changes).argmax()) + 1
    delays = delays_of(images)
    changed = np.median(delays[at : at + NEIGHBOURS]) - np.median(delays[max(at - NEIGHBOURS, 0) : at])
    if abs(changes[at - 1]) < MIN_STEP_S or abs(changed) < MIN_STEP_S:
        return ""
    first, last = images[max(at - NEIGHBOURS, 0), 1], images[min(at + NEIGHBOURS, len(images)) - 1, 1]
    middle, times = images[at, 1], odometry[:, 1]
    before, after = (times >= first) & (times < middle), (times >= middle) & (times <= last)
    if not before.any() or not after.any():
        return ""
    others = delays_of(odometry)
    if abs(np.median(others[after]) - np.median(others[before])) > 0.5 * abs(changed):
        return ""
    return (
        f"from image {at} on, the camera's clock is {abs(changed):.1f} s {'slow' if changed > 0.0 else 'fast'} against "
        "odometry's, and was not before: poses are off by what the robot drives in that time; let one clock stamp both "
        "(chrony, PTP), or split the log there"
    )


def delays_of(times: Stamps) -> Array:
    """Seconds between stamps and log times (N, 2), ns: (N,)."""
    delays: Array = (times[:, 1] - times[:, 0]) / 1e9
    return delays
