"""The logs that a run goes through: opened, and cut into drives of the frames that are used."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby, pairwise
from typing import Literal

import numpy as np

from omninav.stages.geometry.arrays import Array, Ints
from omninav.stages.geometry.plane.se2 import between
from omninav.stages.recordings.live_record import LiveRecording
from omninav.stages.recordings.recording import Recording, UnreadableRecording

from .cuts import Cut, as_if_driven, check_cuts, crossed, remaining_frames, thinned

NEW_LOG_AFTER_S = 3600.0
"""Longest pause within a log, seconds: a longer one begins another, since several days may be in one file."""
STILL = 1e-9
"""Metres and radians: below, odometry has not changed between two images."""
MIN_STEP_M, MIN_STEPS, MIN_DISTANCE_M = 0.01, 5, 0.5
"""Truth that moves by this much between two images, so often in a row and so far in all, is neither noise nor a robot
that was lifted."""
MIN_JUMP_M, JUMP_RATIO, MAX_LEFT = 1.0, 10.0, 0.3
"""Smallest jump of truth against odometry (m, and times the median difference of their steps), and the share of it that
may be left once the truth has jumped back."""
STRIDE_M, MIN_STRIDES, MAX_RATIO = 1.0, 5, 2.0
"""Metres of truth over which odometry is compared with it, well above its noise; how many of them at
least; and the ratio of their lengths that neither slip nor wear explains."""
OdometryKind = Literal["measured", "synthetic", "guessed"]


@dataclass(frozen=True)
class LogPart:
    """One drive of a recording: between two pauses, or all of it.

    `frames`: those that are used. `driven` (N, 3): at all frames the odometry, or the truth where there is none, as if
    what was cut out had not been driven. `truth` (N, 3) or None. `kind`: where motion comes from.
    """

    recording: Recording
    frames: Ints
    driven: Array
    truth: Array | None
    kind: OdometryKind


def parts_of(
    recording: Recording,
    truth: Array | None,
    cuts: Sequence[Cut],
    selected: slice,
    rate_hz: float | None,
    guess: bool,
) -> list[LogPart]:
    """The drives of a recording. `guess`: motion is guessed where none is measured, though positions may be known.

    `selected`: of the frames that the cuts leave. Raises `UnreadableRecording` where no frame is left.
    """
    stamps = recording.stamps
    if truth is not None and not isinstance(recording, LiveRecording):  # whose replay has what the run had
        truth = _without_excursions(recording, truth)
    check_cuts(cuts, len(stamps), recording.name)
    frames = thinned(remaining_frames(cuts, len(stamps))[selected], stamps, rate_hz)
    if not len(frames):
        raise UnreadableRecording(
            f"{recording.name}: first={selected.start}, stop={selected.stop} leaves none of its frames; "
            "type nodes.source.first=0 nodes.source.stop=null"
        )
    poses = truth if recording.odometry is None else recording.odometry
    driven = np.empty((0, 3)) if poses is None else as_if_driven(poses, cuts)
    steps = np.diff(stamps[frames])
    if isinstance(recording, LiveRecording):
        ends = steps <= 0  # its run continued after pauses, and not where its clock was set back
    else:
        ends = (steps > NEW_LOG_AFTER_S * 1e9) & ~crossed(cuts, frames)
    kind = _odometry_kind(recording, truth, guess)
    return [LogPart(recording, part, driven, truth, kind) for part in np.split(frames, np.flatnonzero(ends) + 1)]


def pauses(parts: Sequence[LogPart]) -> list[str]:
    """Sentences on pauses in a recording after which another drive begins, one for each recording."""
    said: list[str] = []
    for recording, group in groupby(parts, key=lambda part: part.recording):
        ends = [(int(one.frames[-1]), int(other.frames[0])) for one, other in pairwise(group)]
        seconds = [float(recording.stamps[begin] - recording.stamps[end]) / 1e9 for end, begin in ends]
        if seconds and max(seconds) > 0.0:
            more = f", as after {len(ends) - 1} more" if len(ends) > 1 else ""
            said.append(
                f"{recording.name}: no image for {seconds[0] / 3600.0:.1f} h after image {ends[0][0]}{more}: what "
                "follows counts as another drive; check the clock if the robot did not pause"
            )
    return said


def frozen_steps(odometry: Array, truth: Array) -> tuple[int, float]:
    """Number of images between which odometry stood still while the truth moved on, and how far that went (m).

    Both are poses (N, 3) at the images; a row of truth that is NaN moves nothing.
    """
    still = (np.abs(between(odometry[:-1], odometry[1:])) < STILL).all(axis=1)
    moved = np.hypot(*(truth[1:, :2] - truth[:-1, :2]).T)
    frozen = still & (moved > MIN_STEP_M)
    steps, metres, at = 0, 0.0, 0
    for is_frozen, group in groupby(frozen.tolist()):
        length = len(list(group))
        away = np.hypot(*(truth[at : at + length + 1, :2] - truth[at, :2]).T)
        if is_frozen and length >= MIN_STEPS and away.max() >= MIN_DISTANCE_M:  # a circle comes back
            steps, metres = steps + length, metres + float(moved[at : at + length].sum())
        at += length
    return steps, metres


def odometry_scale(odometry: Array, truth: Array) -> float | None:
    """Times as far as truth that odometry drives, where that is no robot's error; else None.

    Both are poses (N, 3) at the images, NaN where truth is not known. It is the median over strides of truth, so that
    a robot that stood, slipped for a while or was carried changes nothing.
    """
    known = np.flatnonzero(np.isfinite(truth).all(axis=1))
    if not len(known):
        return None
    ends = [known[0]]
    for row in known[1:]:
        if np.hypot(*(truth[row, :2] - truth[ends[-1], :2])) >= STRIDE_M:
            ends.append(row)
    true, driven = (np.hypot(*np.diff(poses[ends, :2], axis=0).T) for poses in (truth, odometry))
    ratio = float(np.median(driven / true)) if len(true) >= MIN_STRIDES else 1.0
    return None if 1.0 / MAX_RATIO <= ratio <= MAX_RATIO else ratio


def truth_excursion(odometry: Array, truth: Array) -> tuple[int, int, float] | None:
    """The first and last image that the truth places elsewhere than those before and after, and by how much (m).

    Both are poses (N, 3) at the images, of truth NaN where it is not known. There the truth jumps and odometry does
    not, and jumps back; a robot that is carried does not come back to where odometry has it.
    """
    known = np.flatnonzero(np.isfinite(truth).all(axis=1))
    driven, true = odometry[known], truth[known]
    if len(known) < 3:
        return None

    def missed(first: Ints, second: Ints) -> Array:
        off = between(true[first], true[second]) - between(driven[first], driven[second])
        return np.hypot(off[..., 0], off[..., 1])

    images = np.arange(len(known))
    jumps = missed(images[:-1], images[1:])
    jumped = np.flatnonzero(jumps > max(MIN_JUMP_M, JUMP_RATIO * float(np.median(jumps))))
    first, last = jumped[:-1], jumped[1:]
    left = np.flatnonzero(missed(first, last + 1) < MAX_LEFT * np.minimum(jumps[first], jumps[last]))
    if not len(left):
        return None
    one, other = int(first[left[0]]), int(last[left[0]])
    return int(known[one + 1]), int(known[other]), float(jumps[one])


def _without_excursions(recording: Recording, truth: Array) -> Array:
    """True poses (N, 3) without those of images where the truth jumps and odometry does not, which are counted."""
    truth = truth.copy()
    while recording.odometry is not None and (found := truth_excursion(recording.odometry, truth)) is not None:
        first, last, metres = found
        recording.dropped["truth_jump"] += last - first + 1
        recording.details.setdefault(
            "truth_jump",
            f"{recording.name}: ground truth jumps by {metres:.1f} m, where odometry does not, and back: images "
            f"{first} to {last}; did the tracker lose the robot?",
        )
        truth[first : last + 1] = np.nan
    return truth


def _odometry_kind(recording: Recording, truth: Array | None, guess: bool) -> OdometryKind:
    if recording.odometry is not None:
        return "measured"
    if guess or isinstance(recording, LiveRecording):  # which knew no true pose before its time
        return "guessed"
    return "synthetic" if truth is not None and np.isfinite(truth).all() else "guessed"
