"""Playing recordings: one tick per usable image, whether they were written by a robot or are simulated."""

import hashlib
import math
from abc import ABC, abstractmethod
from collections import Counter
from pathlib import Path
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Source, Tick, counted, digest_file, user_path
from omninav.pipeline.engine.code_version import module_version
from omninav.stages.geometry.plane.se2 import between, compose
from omninav.stages.recordings.live_record import LiveRecording
from omninav.stages.recordings.plausibility import MotionLimits
from omninav.stages.recordings.recording import AHEAD, Recording, UnreadableRecording
from omninav.stages.recordings.stamps import TRUTH_MAX_GAP_S
from omninav.stages.recordings.truth_file import truth_from
from omninav.stages.values.commands import GoalPoint, Reinitialise
from omninav.stages.values.image import Image
from omninav.stages.values.pose import Motion, Pose

from .cuts import Cut, remaining_frames
from .dead_reckoning import DeadReckoning
from .log_parts import LogPart, frozen_steps, odometry_scale, parts_of, pauses
from .outputs import DriveOutputs, motion_of, pose_of

LOW_RATE_HZ, LOW_SHARE, FEW_IMAGES = 0.2, 0.05, 3
"""Images a second below which a rate is a slip if it uses less than this share of all images, and the number of images
below which any rate is."""
MAX_UNUSED = 0.1
"""Share of images that cannot be used above which figures of the others mislead."""


class PlaybackState(DeadReckoning):
    """Position in the recordings: recording, next frame and last used frame (-1: none) as positions in the selection,
    and ticks made; of odometry that is synthetic or guessed, the position so far."""

    log: int = 0
    next: int = 0
    last: int = -1
    ticks: int = 0


class Playback(Source, ABC):
    """Plays recordings one after another, wherever they come from; `LogSource` states what it gives."""

    limits: MotionLimits = MotionLimits()
    """Limits of the robot: odometry and truth beyond it are dropped, counted, and odometry's gaps bridged."""
    truth: str | None = None
    """The true poses, where they are not on the log's own topic: a file beside it (TUM, or a CSV with time, x, y and
    heading), a topic, or a frame of a tf topic as /tf:PARENT:CHILD."""
    truth_clock_offset_s: Annotated[float, Bounds(ge=-1e10, le=1e10)] = 0.0
    """The file's clock minus the log's: an image taken at t is looked up in the file at t + this."""
    truth_max_gap_s: Annotated[float, Bounds(gt=0, le=3600)] = TRUTH_MAX_GAP_S
    """Largest time between an image and a true pose, seconds; on a topic that is slower, its usual interval."""
    first: Annotated[int, Bounds(ge=0)] = 0
    """Number of the frame at which each log begins; 0: the first."""
    stop: Annotated[int, Bounds(ge=1)] | None = None
    """Number of the frame before which each log ends; null: all frames are used."""
    stride: Annotated[int, Bounds(ge=1)] = 1
    """Every how many frames one is used."""
    cuts: tuple[Cut, ...] = ()
    """A kidnapping made of a log that has none: [[60, 300]] continues with frame 300 of each log once the first 60 are
    through, and odometry has not noticed."""
    rate_hz: Annotated[float, Bounds(gt=0, le=1e6)] | None = None
    """Images per second that are used at most; of a folder of images without times, how many were taken. Null: all."""

    class Out(DriveOutputs):
        """Inputs known at an image."""

    @abstractmethod
    def recordings(self) -> list[Recording]:
        """Open the recordings. Raises `UnreadableRecording`."""

    def setup(self, ctx: Context) -> None:
        """Open all recordings; what is lost by then is counted."""
        self._open()
        for recording, lost in zip(self._opened, self._lost, strict=True):
            for kind, number in sorted(lost.items()):
                ctx.count(kind, number, recording.details.get(kind, ""))
        ctx.fact("odometry", ", ".join(dict.fromkeys(part.kind for part in self._parts)))
        for sentence in (sentence for recording in self._opened for sentence in recording.assumed):
            ctx.warn(f"assumed: {sentence}")
        known = [sentence for recording in self._opened for sentence in recording.warnings]
        for sentence in dict.fromkeys([*known, *self._doubts, *pauses(self._parts)]):
            ctx.warn(sentence)
        if sentence := self._few_used():
            ctx.warn(sentence)
        for part in self._parts:
            self._begin(ctx, part)

    def inputs_digest(self) -> str | None:
        """sha256 over the content of all recordings, in their order."""
        self._open()
        whole = hashlib.sha256()
        for recording in self._opened:
            whole.update(recording.digest().encode())
            model = type(recording.camera).__module__
            if not model.startswith("omninav."):  # its code may change while its name stays
                whole.update(module_version(model).encode())
        if self._truth_file is not None:
            whole.update(digest_file(self._truth_file).encode())
        return whole.hexdigest()

    def length(self) -> int | None:
        """Ticks to come if every image can be decoded."""
        self._open()
        return sum(len(part.frames) for part in self._parts)

    def step(self, ctx: Context, position: PlaybackState) -> Out | None:
        """The next image that can be used; None after the last."""
        while position.log < len(self._parts):
            part = self._parts[position.log]
            recording, frames = part.recording, part.frames
            while position.next < len(frames):
                frame = int(frames[position.next])
                known = dict(recording.dropped)
                pixels = recording.image(frame, frames[position.next + 1 :][:AHEAD].tolist())
                if pixels is not None:
                    return self._out(ctx, position, part, Image(pixels))
                for kind, number in sorted((Counter(recording.dropped) - Counter(known)).items()):
                    ctx.count(kind, number, recording.details.get(kind, ""))
                position.next += 1
            position.log, position.next, position.last = position.log + 1, 0, -1
            position.x = position.y = position.heading = 0.0
        if not position.ticks:
            lost = sum((recording.dropped for recording in self._opened), Counter[str]())
            details = [detail for recording in self._opened for detail in recording.details.values()]
            counts = ", ".join(f"{number} {kind}" for kind, number in sorted(lost.items()))
            first = (details or [""])[-1]
            name = self._opened[0].name
            raise UnreadableRecording(f"{name}: not one of its images can be used ({counts}; {first:.300})")
        images = sum(len(part.frames) for part in self._parts)
        if (unused := images - position.ticks) > MAX_UNUSED * images:
            ctx.warn(f"{unused} of {images} images could not be used: figures, as the share lost, are of the others")
        return None

    def _out(self, ctx: Context, position: PlaybackState, part: LogPart, image: Image) -> Out:
        recording, frames = part.recording, part.frames
        frame, first = int(frames[position.next]), position.last < 0
        tick = Tick(
            index=position.ticks,
            stamp=int(recording.stamps[frame]),
            log=position.log,
            frame=frame,
            first_of_log=first,
        )
        truth = None if part.truth is None else part.truth[frame]
        restart, goal = _requests(part, self._last_used(position), frame)
        odometry, motion = self._motion(ctx, position, part, image)
        position.last, position.next, position.ticks = position.next, position.next + 1, position.ticks + 1
        return self.Out(
            tick=tick,
            image=image,
            camera=recording.camera,
            odometry=odometry,
            motion=motion,
            truth=pose_of(truth),
            scan=recording.scan(frame) if ctx.is_read("scan") else None,
            restart=restart,
            goal=goal,
        )

    def _last_used(self, position: PlaybackState) -> int:
        """The last frame of the recording that was used, also in an earlier part of it; -1: none."""
        if position.last >= 0:
            return int(self._parts[position.log].frames[position.last])
        before = self._parts[position.log - 1] if position.log else None
        same = before is not None and before.recording is self._parts[position.log].recording
        return int(before.frames[-1]) if before is not None and same else -1

    def _few_used(self) -> str:
        """Sentence on a rate by which hardly any image is used; "" otherwise."""
        used, chosen = sum(len(part.frames) for part in self._parts), slice(self.first, self.stop, self.stride)
        taken = sum(len(remaining_frames(self.cuts, len(each.stamps))[chosen]) for each in self._opened)
        few = self.rate_hz is not None and self.rate_hz < LOW_RATE_HZ and used < LOW_SHARE * taken
        if self.rate_hz is None or used == taken or not (few or used < FEW_IMAGES):
            return ""
        return f"rate={self.rate_hz:g} uses {used} of {counted(taken, 'image')}: type a higher one, or leave it out"

    def _begin(self, ctx: Context, part: LogPart) -> None:
        """Say what one has to know of a drive before it begins."""
        recording, truth = part.recording, part.truth
        if recording.odometry is None or truth is None:
            return
        steps, metres = frozen_steps(recording.odometry, truth)
        if steps:
            still = f"odometry stands still at {counted(steps, 'image')}, ground truth moves {metres:.1f} m"
            ctx.warn(f"{recording.name}: {still}")
        elif (times := odometry_scale(recording.odometry[part.frames], truth[part.frames])) is not None:
            ctx.warn(
                f"{recording.name}: odometry drives {times:.2g} times as far as ground truth: check that both are in "
                "metres, and of the same robot"
            )

    def _motion(
        self, ctx: Context, position: PlaybackState, part: LogPart, image: Image
    ) -> tuple[Pose | None, Motion | None]:
        """The odometry pose at the next frame, and the increment since the frame that was used last."""
        recording, frame = part.recording, int(part.frames[position.next])
        odometry = part.driven[frame]
        if position.last < 0:
            return pose_of(odometry), None
        last = int(part.frames[position.last])
        gap = 0.0 if recording.unmeasured_s2 is None else float(np.ptp(recording.unmeasured_s2[[last, frame]]))
        return pose_of(odometry), motion_of(between(part.driven[last], odometry), math.sqrt(gap))

    @property
    def _truth_file(self) -> Path | None:
        """The file of true poses; None where they come from a topic."""
        if self.truth is None:
            return None
        path = Path(self.truth)
        topic = self.truth.startswith("/") and not path.suffix and not path.exists()
        return None if topic else user_path(self.truth)

    def _guesses(self) -> bool:
        """Tells that motion is guessed where none is measured, though positions may be known."""
        return False

    def _open(self) -> None:
        if getattr(self, "_opened", None) is not None:
            return
        recordings = self.recordings()
        selected = slice(self.first, self.stop, self.stride)
        self._parts: list[LogPart] = []
        self._doubts: list[str] = []
        for recording in recordings:
            truth, file = recording.truth, self._truth_file
            if file is not None:
                truth, doubts = truth_from(
                    recording, file, self.truth_clock_offset_s, self.truth_max_gap_s, self.limits
                )
                self._doubts += doubts
            self._parts += parts_of(recording, truth, self.cuts, selected, self.rate_hz, self._guesses())
        self._opened = recordings
        self._lost = [recording.dropped.copy() for recording in recordings]


def _requests(part: LogPart, last: int, frame: int) -> tuple[Reinitialise | None, GoalPoint | None]:
    """Finds the last requests to a live run after its frame `last`, up to this one; a pose is moved on by odometry."""
    restart, goal = None, None
    if isinstance(part.recording, LiveRecording):
        for each in range(last + 1, frame + 1):
            asked = part.recording.frame(each)
            goal = asked.goal or goal
            if asked.restart is not None:
                restart, at = asked.restart, each
    if restart is None or not isinstance(restart.at, tuple) or at == frame:
        return restart, goal
    x, y, heading = compose(restart.at[:3], between(part.driven[at], part.driven[frame])).tolist()
    return Reinitialise((x, y, heading, *restart.at[3:])), goal
