"""The poses of one topic as they come: each is believed, left out or doubted until the next ones decide."""

from collections import Counter, deque
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.plane.se2 import between, compose, interpolate

from .plausibility import (
    EXCURSION_S,
    SILENCE_S,
    SILENT_INTERVALS,
    MotionLimits,
    possible_between,
    silent,
    squares_within,
)
from .stamps import TRUTH_MAX_GAP_S, max_step_s

KEPT_S = 30.0
"""Longest time back for which a pose can be asked."""
SMALL_STEP = 0.5
"""Largest part of a jump by which poses go on after it: back from a single wrong pose leads the whole of it."""
MAX_PAUSE_S = 10.0
"""A message that comes later than this after the last tells of a clock that leapt, until others follow it."""


class _Pose(NamedTuple):
    stamp: int
    pose: Array
    item: Any


class LiveTrack:
    """Poses (x, y, heading) at ascending stamps (ns), as far as they have come.

    What no robot can have driven, and what is before the last stamp or long after it, is doubted: dropped where the
    track continues as before, and believed once it has continued for `EXCURSION_S` by itself. Then odometry is joined
    to where it was (`jumps` false), or the truth starts again there; where stamps went back, all before is forgotten.
    `dropped` counts by kind what was left out, `details` tells of the first of each. What comes of it depends on what
    was kept alone: fed with that, another track gives the same.
    """

    def __init__(self, limits: MotionLimits, jumps: bool) -> None:
        self.dropped: Counter[str] = Counter()
        self.details: dict[str, str] = {}
        self._limits, self._jumps = limits, jumps
        self._known: deque[_Pose] = deque()
        self._doubted: list[_Pose] = []
        self._gaps: list[tuple[int, int]] = []
        self._origin: tuple[Array, Array] | None = None

    @property
    def last(self) -> int | None:
        """Stamp of the last pose that is believed."""
        return self._known[-1].stamp if self._known else None

    def add(self, stamp: int, pose: Sequence[float], item: Any = None) -> list[Any]:
        """Take a pose. Returns the items of all poses that are now believed and were not before, in their order."""
        new = _Pose(stamp, np.array(pose, dtype=np.float64), item)
        if not np.isfinite(new.pose).all():
            self._drop("impossible_pose", f"of {stamp / 1e9:.3f} s is not finite")
            return []
        if self._known and stamp == self._known[-1].stamp:
            self._drop("duplicate_stamp", f"of {stamp / 1e9:.3f} s has come before")
            return []
        if not self._known or (self._follows(self._known[-1], new, joined=True) and not self._goes_on(new)):
            self._drop_doubted()
            self._append(new)
            return [item]
        if self._doubted and not self._follows(self._doubted[-1], new, joined=False):
            self._drop_doubted()
        self._doubted.append(new)
        if stamp - self._doubted[0].stamp < EXCURSION_S * 1e9:
            return []
        return self._believe_doubted()

    def at(self, stamp: int) -> Array | None:
        """The pose (3,) at a stamp, interpolated; None where none is known on either side of it, or the truth between
        them is silent or jumps."""
        after = next((k for k in range(len(self._known) - 1, -1, -1) if self._known[k].stamp <= stamp), None)
        if after is None:
            return None
        one = self._known[after]
        if one.stamp == stamp:
            return one.pose
        if after + 1 == len(self._known):
            return None
        other = self._known[after + 1]
        if self._jumps and not self._joined(one, other):
            return None
        times = np.array([0, other.stamp - one.stamp]) / 1e9
        pose: Array = interpolate(times, np.stack([one.pose, other.pose]), np.array([stamp - one.stamp]) / 1e9)[0]
        return pose

    def _joined(self, one: _Pose, other: _Pose) -> bool:
        """Tells whether true poses between two known ones may be interpolated."""
        possible = possible_between(one.pose, other.pose, (other.stamp - one.stamp) / 1e9, self._limits)
        return possible and not self._silent(one, other, 2.0 * TRUTH_MAX_GAP_S, 2.0)

    def _silent(self, one: _Pose, other: _Pose, seconds: float, intervals: float) -> bool:
        """Tells whether a robot moved unseen between two poses, more than so many seconds and usual intervals apart."""
        if other.stamp - one.stamp <= seconds * 1e9:
            return False
        apart = max_step_s(np.array([known.stamp for known in self._known]), seconds, intervals)
        return bool(silent(np.array([one.stamp, other.stamp]), np.stack([one.pose, other.pose]), apart)[0])

    def reported(self, pose: Array) -> Array:
        """A pose of the track in the frame of the newest messages that are believed: undoes what was joined."""
        if self._origin is None:
            return pose
        jumped, joined = self._origin
        theirs: Array = compose(jumped, between(joined, pose))
        return theirs

    def unmeasured_s2(self, stamp: int) -> float:
        """Squared lengths (s^2) up to a stamp of gaps in which no measurement is believed, summed."""
        gaps = np.array(self._gaps, np.int64).reshape(-1, 2)
        return float(squares_within(gaps, np.array([stamp], np.int64))[0])

    def _follows(self, before: _Pose, after: _Pose, joined: bool) -> bool:
        seconds = (after.stamp - before.stamp) / 1e9
        if not 0 < seconds <= MAX_PAUSE_S:
            return False
        pose = self._join(after.pose) if joined else after.pose
        return possible_between(before.pose, pose, seconds, self._limits)

    def _goes_on(self, new: _Pose) -> bool:
        """Tells whether a pose goes on from the doubted ones, by a step that is small beside their jump.

        With the time since the last believed pose far places become possible, and a reset would be taken for a drive.
        """
        if not self._doubted or not self._follows(self._doubted[-1], new, joined=False):
            return False
        if not 0 < self._doubted[0].stamp - self._known[-1].stamp <= MAX_PAUSE_S * 1e9:
            return False  # doubted for its stamp and not for its place
        jump = self._size(self._known[-1].pose, self._join(self._doubted[0].pose))
        return self._size(self._doubted[-1].pose, new.pose) < SMALL_STEP * jump

    def _size(self, start: Array, end: Array) -> float:
        """Seconds that a robot needs at least from one pose to another."""
        x, y, turn = np.abs(between(start, end))
        return float(max(np.hypot(x, y) / self._limits.speed, turn / self._limits.turn))

    def _believe_doubted(self) -> list[Any]:
        believed, self._doubted = self._doubted, []
        first, last = believed[0], self._known[-1]
        if first.stamp < last.stamp:
            self._known.clear()
            self._gaps.clear()
            if self._origin is not None:  # the odometry of a clock that is set back goes on where it was
                self._origin = first.pose, last.pose
        elif not self._jumps:
            seconds = (first.stamp - last.stamp) / 1e9
            if not possible_between(last.pose, self._join(first.pose), seconds, self._limits):
                self._gaps.append((last.stamp, first.stamp))
                self._origin = first.pose, compose(last.pose, self._step(first.stamp))
        for one in believed:
            self._append(one)
        return [one.item for one in believed]

    def _step(self, stamp: int) -> Array:
        """As far as the robot goes until a stamp if it continues as before, or by one step where that is shorter."""
        if len(self._known) < 2:
            return np.zeros(3)
        one, last = self._known[-2], self._known[-1]
        step: Array = between(one.pose, last.pose) * min(1.0, (stamp - last.stamp) / (last.stamp - one.stamp))
        return step

    def _join(self, pose: Array) -> Array:
        """A measured pose as it would be had the track never jumped."""
        if self._origin is None:
            return pose
        jumped, joined = self._origin
        whole: Array = compose(joined, between(jumped, pose))
        return whole

    def _append(self, new: _Pose) -> None:
        self._known.append(_Pose(new.stamp, self._join(new.pose), None))
        self._note_silence()
        while new.stamp - self._known[0].stamp > KEPT_S * 1e9 and len(self._known) > 2:
            self._known.popleft()

    def _note_silence(self) -> None:
        """Let the time before the newest pose be a gap where odometry was silent."""
        if self._jumps or len(self._known) < 2:
            return
        one, other = self._known[-2], self._known[-1]
        gap = one.stamp, other.stamp
        if gap not in self._gaps[-1:] and self._silent(one, other, SILENCE_S, SILENT_INTERVALS):
            self._gaps.append(gap)
            self._drop("odometry_silence", f"of {gap[1] / 1e9:.3f} s comes {(gap[1] - gap[0]) / 1e9:.1f} s late")

    def _drop_doubted(self) -> None:
        for one in self._doubted:
            late = bool(self._known) and one.stamp > self._known[-1].stamp
            kind = "impossible_motion" if late else "backward_stamp"
            if late and one.stamp - self._known[-1].stamp > MAX_PAUSE_S * 1e9:
                kind = "lone_stamp"
            beside = ""
            if self._known:
                last = self._known[-1]
                metres = float(np.hypot(*(self._join(one.pose) - last.pose)[:2]))
                beside = f", {metres:.2f} m and {(one.stamp - last.stamp) / 1e9:.3f} s from the one before"
            self._drop(kind, f"of {one.stamp / 1e9:.3f} s{beside}; do two nodes publish?")
        self._doubted.clear()

    def _drop(self, kind: str, detail: str) -> None:
        self.dropped[kind] += 1
        self.details.setdefault(kind, f"a pose {detail}")
