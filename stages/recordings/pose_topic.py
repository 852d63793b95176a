"""The poses on one topic, also of transforms: gathered as they are read, put in order, impossible ones left out."""

import math
from array import array
from typing import Any, NamedTuple

import numpy as np

from omninav.pipeline.mcap.message import Record
from omninav.stages.geometry.arrays import Array, Ints

from .messages import TRANSFORMS_TYPES, pose_of
from .plausibility import SILENCE_S, SILENT_INTERVALS, MotionLimits, believed, silent, without_jumps
from .recording import UnreadableRecording
from .stamps import Stamps, max_step_s
from .topic_recording import Feed, in_order, require_stamps

MAX_STAMP = 2**63 - 1
"""Largest time stamp, ns: the year 2262. A later one is out of order in any log."""
NOWHERE = (float("nan"),) * 3
MAX_FRAMES = 20
"""Pairs of frames that are named where the wanted one is not there."""


class PoseTrack(NamedTuple):
    """Poses (N, 3) at ascending stamps (N,) in ns; `gaps` (G, 2): stamps between which no measurement is believed, or
    those about each jump of a track that may jump."""

    stamps: Stamps
    poses: Array
    gaps: Stamps


class PoseTopic:
    """Stamps, log times and poses of a topic's messages: 40 bytes each, since a log may hold millions."""

    def __init__(self, topic: str) -> None:
        self.topic = topic
        self._stamps, self._log_times, self._poses = array("q"), array("q"), array("d")

    def __len__(self) -> int:
        return len(self._stamps)

    @property
    def times(self) -> Stamps:
        """Stamps and log times (N, 2), ns."""
        return np.column_stack((np.array(self._stamps, np.int64), np.array(self._log_times, np.int64)))

    def add(self, stamp: int, log_time: int, pose: tuple[float, float, float]) -> None:
        """One message; `NOWHERE` for one whose pose cannot be."""
        self._stamps.append(min(stamp, MAX_STAMP))
        self._log_times.append(min(log_time, MAX_STAMP))
        self._poses.extend(pose)

    def track(self, feed: Feed, name: str, limits: MotionLimits, jumps: bool) -> PoseTrack | None:
        """The believed part of a message; None where nothing is. Skipped data is counted with `feed`.

        `jumps`: the track may jump, as the true pose of a robot does that is carried; else it is joined where it does,
        and `UnreadableRecording` is raised where most of it is not believed.
        """
        poses, stamps = np.array(self._poses).reshape(-1, 3), np.array(self._stamps, np.int64)
        if not jumps:
            cure = ", or type topics.odometry=null to do without"
            require_stamps(name, self.topic, "messages", stamps, cure)
        kept = in_order(feed, name, self.topic, stamps, np.array(self._log_times, np.int64))
        stamps, poses = stamps[kept], poses[kept]
        rows, begun, gaps = believed(stamps, poses, limits)
        unlikely = np.setdiff1d(np.flatnonzero(np.isfinite(poses).all(axis=1)), rows)
        said = self._drop(feed, name, "impossible_motion", stamps, poses, unlikely, limits)
        if not jumps and 2 * len(unlikely) > len(poses):
            raise UnreadableRecording(f"{said}; or type topics.odometry=null to do without")
        if not len(rows):
            return None
        stamps, poses = stamps[rows], poses[rows]
        if jumps:
            gaps = np.column_stack([stamps[begun - 1], stamps[begun]])
        else:
            self._drop(feed, name, "odometry_jump", stamps, poses, begun, limits)
            poses = without_jumps(stamps, poses, begun)
            gaps = self._with_silences(feed, name, stamps, poses, gaps)
        return PoseTrack(stamps, poses, gaps)

    def _with_silences(self, feed: Feed, name: str, stamps: Stamps, poses: Array, gaps: Stamps) -> Stamps:
        """Gaps (G, 2) and the track's silences, which are counted, in their order."""
        rows = np.flatnonzero(silent(stamps, poses, max_step_s(stamps, SILENCE_S, SILENT_INTERVALS)))
        rows = rows[~np.isin(stamps[rows], gaps[:, 0])]
        silences = np.column_stack([stamps[rows], stamps[rows + 1]])
        for begun, ended in silences:
            where = f"{name}: {self.topic} is silent for {(ended - begun) / 1e9:.1f} s from {begun / 1e9:.3f} s on"
            feed.drop("odometry_silence", f"{where}; the motion in it is uncertain")
        return np.sort(np.concatenate([gaps, silences]), axis=0)

    def _drop(
        self, feed: Feed, name: str, kind: str, stamps: Stamps, poses: Array, rows: Ints, limits: MotionLimits
    ) -> str:
        """Count some rows of a track, and report of the first what it would need of the robot, by its neighbour."""
        if not len(rows):
            return ""
        row = int(rows[0])
        other = row - 1 if row else min(1, len(poses) - 1)
        metres = math.hypot(*(poses[row, :2] - poses[other, :2]).tolist())
        seconds = abs(float(stamps[row] - stamps[other])) / 1e9
        where = f"{name}: {self.topic} at {stamps[row] / 1e9:.3f} s"
        detail = (
            f"{where}: {metres:.3g} m from its neighbour {seconds:.3g} s away; "
            f"believed are {limits.speed:g} m/s and {limits.turn:.3g} rad/s (nodes.source.limits)"
        )
        if 2 * len(rows) > len(poses):
            detail += "; most are like this: check the unit (m, rad)"
        for _ in rows:
            feed.drop(kind, detail)
        return detail


class TransformTopic(PoseTopic):
    """Transforms of `child` in `parent` from a topic (`/tf`), in the order of their own stamps.

    A name without a child (`/tf:odom:`) is of the first child that comes.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        topic, self.parent, self.child = (*name.split(":"), "", "")[:3]
        super().__init__(topic)
        self._seen: dict[str, None] = {}

    def add_message(self, record: Record, message: Any) -> None:
        """Every transform in it that is meant. Raises ValueError for one that cannot be, as `pose_of`."""
        for each in message.transforms:
            frames = each.header.frame_id.strip("/"), each.child_frame_id.strip("/")
            if not self.child and frames[0] == self.parent:
                self.child = frames[1]
            if frames == (self.parent.strip("/"), self.child.strip("/")):
                at = each.header.stamp
                self.add(at.sec * 1_000_000_000 + at.nanosec, record.log_time, pose_of(each))
            elif len(self._seen) < MAX_FRAMES:
                self._seen[":".join(frames)] = None

    def require(self, log: str, setting: str, kind: str) -> None:
        """Raise `UnreadableRecording` where there was no such transform, naming those that there were.

        `setting`: what the user typed it for. `kind`: type of the topic's messages, or empty.
        """
        if kind not in TRANSFORMS_TYPES:
            raise UnreadableRecording(
                f"{log}: {self.topic} carries {kind or 'nothing'}, not transforms; {setting}=/tf:PARENT:CHILD"
            )
        if not len(self):
            known = ", ".join(f"{self.topic}:{pair:.80}" for pair in self._seen) or "none"
            if setting == "truth" and {self.parent, self.child} <= {
                frame for pair in self._seen for frame in pair.split(":")
            }:
                known += " (of these, those to and from odom are a localiser's and odometry's, no truth)"
            raise UnreadableRecording(f"{log}: no transform {self.name:.80}; type {setting}= with one of: {known}")
