"""The source of recorded drives: one tick per usable image."""

import hashlib
import math
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Context, Source, State, Tick
from omninav.pipeline.engine.code_version import module_version
from omninav.pipeline.files import digest_file, digest_text, user_path
from omninav.pipeline.graph.problems import counted
from omninav.stages.geometry.plane.se2 import between
from omninav.stages.recordings.decode_ahead import AHEAD
from omninav.stages.recordings.image_folder import ImageFolder
from omninav.stages.recordings.live_record import LiveRecording
from omninav.stages.recordings.opening import open_recording
from omninav.stages.recordings.plausibility import MotionLimits
from omninav.stages.recordings.recording import Recording, Topics, UnreadableRecording
from omninav.stages.recordings.truth_file import truth_from
from omninav.stages.simulator.config import Kidnapping, WorldConfig
from omninav.stages.values.image import Image
from omninav.stages.values.pose import GuessedPose, Motion, Pose

from .cuts import Cut
from .frozen_odometry import frozen_steps
from .guessed_motion import VisualCompass, advance, reckon, settled_speed
from .log_parts import LogPart, Selection, parts_of, pauses, simulated_drives
from .outputs import DriveOutputs, motion_of, pose_of
from .synthetic_odometry import add_odometry_noise

Array = npt.NDArray[np.float64]
DRIVE = "drive.mcap"
"""A simulated drive in the folder of its recording."""
SYNTHETIC_DISTANCE_NOISE = 0.1
"""Standard deviation of synthetic odometry's distance after one metre, metres; it grows with the root of the path."""
SYNTHETIC_TURN_NOISE_DEG_PER_M = 3.0
"""Standard deviation of synthetic odometry's heading after one metre, degrees."""
SYNTHETIC_TURN_NOISE_DEG_PER_RAD = 3.0
"""Standard deviation that a turn of one radian adds to it, degrees."""


class LogSourceState(State):
    """Where in the logs the source is: log, next frame and last used frame (-1: none) as positions in the selection,
    ticks made, the synthetic or guessed odometry so far (x, y in metres, heading in radians), and what the compass
    keeps of the last image."""

    log: int = 0
    next: int = 0
    last: int = -1
    ticks: int = 0
    x: float = 0.0
    y: float = 0.0
    heading: float = 0.0
    view: npt.NDArray[np.float32] | None = None


class LogSource(Source):
    """Plays recorded drives one after another: a tick for every image that can be used.

    Poses are metres and radians; stamps are header stamps. `motion` is the SE(2) increment of the odometry between the
    images' own times, absent at the first image of each log; where images are left out it spans the gap.

    A recording without odometry but with positions gets a synthetic one (`odometry: synthetic` in the manifest): the
    true increment with the noise of `add_odometry_noise`, drawn frame by frame from the run's seed. Raises
    `UnreadableRecording` for a log that cannot be read.

    A log without odometry and positions (a video, images alone) is driven by a guess: `speed_m_s` straight ahead, and
    the turns that a visual compass finds (`odometry: guessed`). A graph that reads its motion tick by tick is refused
    (`UnreadableRecording`) until somebody states that speed.
    """

    log: str | tuple[str, ...] | None = None
    """One recording or several (see `open_recording`). Null: a drive through the simulated `world`."""
    world: WorldConfig = WorldConfig()
    """What is driven through where no log is named."""
    route: str | None = None
    """Which of the world's routes is driven."""
    day: int | tuple[int, ...] = 1
    """On which day of the world, or one after the other on several."""
    kidnappings: tuple[Kidnapping, ...] = ()
    """When and how somebody lifts the robot on the simulated drive: {at: 30.0, turn: 1.5} or {at: 30.0, to: [x, y,
    heading]} (s, m, rad)."""
    topics: Topics = Topics()
    """Which topics of the log are read."""
    limits: MotionLimits = MotionLimits()
    """What the robot can do: odometry and truth beyond it are dropped, counted, and odometry's gaps bridged."""
    truth: str | None = None
    """The true poses, where they are not on the log's own topic: a file beside it (TUM, or a CSV with time, x, y and
    heading), a topic, or a frame of a tf topic as /tf:PARENT:CHILD."""
    truth_clock_offset_s: Annotated[float, Bounds(ge=-1e10, le=1e10)] = 0.0
    """The file's clock minus the log's: an image taken at t is looked up in the file at t + this."""
    truth_max_gap_s: Annotated[float, Bounds(gt=0, le=3600)] = 0.5
    """How far in time a pose of the file may be from an image."""
    camera: str | None = None
    """A camera.yaml in place of the log's own, or a projection (`equirectangular`, …)."""
    layout_folders: tuple[str, ...] = ()
    """Folders with further descriptions of folders of images."""
    first: Annotated[int, Bounds(ge=0)] = 0
    """The first frame of each log that is used."""
    stop: Annotated[int, Bounds(ge=1)] | None = None
    """The first frame of each log that is not used any more; null: none."""
    stride: Annotated[int, Bounds(ge=1)] = 1
    """Every how many frames one is used."""
    cuts: tuple[Cut, ...] = ()
    """A kidnapping made of a log that has none: [[60, 300]] goes on with frame 300 of each log once the first 60 are
    through, and odometry has not noticed."""
    rate_hz: Annotated[float, Bounds(gt=0, le=1e6)] | None = None
    """Images per second that are used at most; of a folder of images without times, how many were taken. Null: all."""
    speed_m_s: Annotated[float, Bounds(ge=0, le=100)] | None = None
    """The guessed speed of a log without odometry; it may be off by as much, or by 0.5 m/s where that is more. 0: only
    the compass's turns are known. Null: noisy positions where the log has some, else a nominal one, for drawing."""
    new_log_after_s: Annotated[float, Bounds(gt=0)] = 3600.0
    """A longer pause begins another log: several days may lie in one file."""

    class Out(DriveOutputs):
        """What is known at an image."""

    def setup(self, ctx: Context) -> None:
        """Open all logs; what is lost by then is counted."""
        self._open()
        for recording, lost in zip(self._opened, self._lost, strict=True):
            for kind, number in sorted(lost.items()):
                ctx.count(kind, number, recording.details.get(kind, ""))
        ctx.fact("odometry", ", ".join(dict.fromkeys(part.kind for part in self._parts)))
        for sentence in (sentence for recording in self._opened for sentence in recording.assumed):
            ctx.warn(f"assumed: {sentence}")
        for sentence in dict.fromkeys([*self._doubts, *pauses(self._parts)]):
            ctx.warn(sentence)
        turned = sum(recording.turned for recording in self._opened if isinstance(recording, ImageFolder))
        if turned:
            ctx.fact("turned_images", f"{turned}, as their EXIF orientation says")
        for part in self._parts:
            recording, truth = part.recording, part.truth
            if part.kind == "synthetic":
                ctx.warn(f"No odometry in {recording.name}: made from its true positions, with noise")
            elif part.kind == "measured" and recording.odometry is not None and truth is not None:
                steps, metres = frozen_steps(recording.odometry, truth)
                if steps:
                    still = f"odometry stands still at {counted(steps, 'image')}, ground truth moves {metres:.1f} m"
                    ctx.warn(f"{recording.name}: {still}")
            elif part.kind == "guessed":
                self._speed = self._settled_speed(ctx, part)

    def check(self, ctx: Context) -> None:
        """Refuse a variant that needs odometry over a log that has none, where no speed is stated."""
        self._open()
        for part in self._parts:
            if part.kind == "guessed":
                self._settled_speed(ctx, part)

    def inputs_digest(self) -> str | None:
        """sha256 over the content of all logs, in their order."""
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

    def recording_key(self) -> str | None:
        """The hash of a simulated drive; None for a recording."""
        if self.log is not None or self.route not in self.world.routes:
            return None
        from omninav.stages.simulator.simulated_recording import drive_digest, in_order

        days = in_order(self.day)
        return digest_text(*(drive_digest(self.world, self.route, day, self.kidnappings) for day in days))

    def recording_name(self) -> str:
        """World, route and days of a simulated drive."""
        return f"{self.world.label} {self.route} day {self.day}{' with kidnappings' if self.kidnappings else ''}"

    def record(self, ctx: Context, folder: Path) -> None:
        """Write a simulated drive as an MCAP log, with camera.yaml, floor plan and grid beside it."""
        from omninav.stages.simulator.record_log import record_log

        assert self.route is not None
        record_log(folder / DRIVE, self.world, self.route, self.day, self.kidnappings, ctx)

    def replay(self, folder: Path) -> dict[str, Any]:
        """Read the log in place of the world that it is of."""
        return {"log": str(folder / DRIVE), "world": None, "route": None, "day": None, "kidnappings": None}

    def step(self, ctx: Context, position: LogSourceState) -> Out | None:
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
        return None

    def _out(self, ctx: Context, position: LogSourceState, part: LogPart, image: Image) -> Out:
        recording, frames, measured = part.recording, part.frames, part.driven
        frame, first = int(frames[position.next]), position.last < 0
        last = None if first else int(frames[position.last])
        tick = Tick(
            index=position.ticks,
            stamp=int(recording.stamps[frame]),
            log=position.log,
            frame=frame,
            first_of_log=first,
        )
        truth = None if part.truth is None else part.truth[frame]
        motion: Motion | None = None
        if recording.odometry is not None:
            odometry = measured[frame]
            if last is not None:
                gap = 0.0 if recording.unmeasured_s is None else float(np.ptp(recording.unmeasured_s[[last, frame]]))
                motion = motion_of(between(measured[last], odometry), gap)
        else:
            if part.kind == "guessed":
                seconds = None if last is None else float(recording.stamps[frame] - recording.stamps[last]) / 1e9
                motion = reckon(self._compass, self._speed, position, image, recording.camera, seconds)
            elif last is not None:
                motion = motion_of(self._synthetic(ctx, between(measured[last], measured[frame])))
                advance(position, motion)
            odometry = np.array([position.x, position.y, position.heading])
        position.last, position.next, position.ticks = position.next, position.next + 1, position.ticks + 1
        return self.Out(
            tick=tick,
            image=image,
            camera=recording.camera,
            odometry=pose_of(odometry, GuessedPose if part.kind == "guessed" else Pose),
            motion=motion,
            truth=pose_of(truth),
            scan=recording.scan(frame) if ctx.is_read("scan") else None,
            restart=recording.restart(frame) if isinstance(recording, LiveRecording) else None,
            goal=recording.goal(frame) if isinstance(recording, LiveRecording) else None,
        )

    @property
    def _truth_file(self) -> Path | None:
        """The file of true poses; None where they come from a topic."""
        if self.truth is None or (self.truth.startswith("/") and not Path(self.truth).exists()):
            return None
        return user_path(self.truth)

    def _settled_speed(self, ctx: Context, part: LogPart) -> float:
        placed = part.truth is not None and not isinstance(part.recording, LiveRecording)
        return settled_speed(ctx, part.recording.name, part.recording.camera, self.speed_m_s, placed)

    def _synthetic(self, ctx: Context, increment: Array) -> Array:
        return add_odometry_noise(
            increment,
            ctx.rng.standard_normal(2),
            SYNTHETIC_DISTANCE_NOISE,
            math.radians(SYNTHETIC_TURN_NOISE_DEG_PER_M),
            math.radians(SYNTHETIC_TURN_NOISE_DEG_PER_RAD),
        )

    def _open(self) -> None:
        if getattr(self, "_opened", None) is not None:
            return
        recordings = self._recordings()
        selection = Selection(self.first, self.stop, self.stride, self.cuts, self.rate_hz, self.new_log_after_s)
        self._parts: list[LogPart] = []
        self._doubts: list[str] = []
        for recording in recordings:
            truth, file = recording.truth, self._truth_file
            if file is not None:
                truth, doubts = truth_from(
                    recording, file, self.truth_clock_offset_s, self.truth_max_gap_s, self.limits
                )
                self._doubts += doubts
            self._parts += parts_of(recording, truth, selection, guess=self.speed_m_s is not None)
        self._compass = VisualCompass()
        self._opened = recordings
        self._lost = [recording.dropped.copy() for recording in recordings]

    def _recordings(self) -> list[Recording]:
        if self.log is None and self.route is not None:
            return simulated_drives(self.world, self.route, self.day, self.kidnappings)
        names = (self.log,) if isinstance(self.log, str) else self.log
        if not names or None in names:
            raise UnreadableRecording("no recording is named; type log=PATH")
        topics = self.topics
        if self.truth is not None and self._truth_file is None:
            topics = replace(topics, truth=self.truth)
        return [
            open_recording(name, topics, self.camera, self.layout_folders, self.limits, self.rate_hz) for name in names
        ]
