"""The source of a robot that runs now: one tick for the newest image that its odometry reaches."""

import math
import signal
import threading
import time
from collections import Counter
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np

from omninav.pipeline import BadInput, Bounds, Context, Source, Tick, user_path
from omninav.pipeline.mcap.reader import LogReader
from omninav.stages.camera.model import Camera, camera_models
from omninav.stages.geometry.plane.se2 import between
from omninav.stages.recordings.camera_yaml import read_camera
from omninav.stages.recordings.live_record import HEADER, Frame, LiveHeader, LiveRecording, OdometryBuffer, Role
from omninav.stages.recordings.plausibility import MotionLimits
from omninav.stages.recordings.recording import Topics, UnreadableRecording
from omninav.stages.recordings.static_transforms import TF_STATIC
from omninav.stages.recordings.topics import IMAGE_TOPICS
from omninav.stages.source.dead_reckoning import DeadReckoning, VisualCompass, assumed_speed, dead_reckon
from omninav.stages.source.outputs import DriveOutputs, motion_of, pose_of
from omninav.stages.values.command import Command
from omninav.stages.values.commands import GOAL_TOPIC
from omninav.stages.values.image import Image, Pixels
from omninav.stages.values.planned_route import PlannedRoute
from omninav.stages.values.pose import AssumedPose, Motion, Pose

from .amcl_services import serve_amcl, serve_restart
from .camera_device import TOPIC, device_camera
from .camera_transport import connect_camera
from .drive_record import DriveRecord, unfinished
from .publish import publish_diagnostics
from .time_synchronizer import TimeSynchronizer
from .transport import Transport, TransportName, connect, disconnect, full_name

LIVE, DEVICE = "live", "camera:"
"""As `log`: a robot, and what a camera of this computer begins with."""
RECORD = "live.mcap"
"""The record in the run's folder."""
WATCH_S = 1.0
"""Seconds between two reports to diagnostics and the terminal."""
PATIENCE_S = 1.0
"""Time for which an image waits for the odometry after it, and for which a topic may be silent, seconds."""


class LiveSourceState(DeadReckoning):
    """Ticks made, logs begun (a clock that is set back begins one), and of the last tick the stamp (ns), the position
    in the odometry's frame, and the squared lengths (s^2) of its gaps. `first` and `ended`: stamps of the first tick,
    and of that at which the planned route ended (0: it has not)."""

    ticks: int = 0
    log: int = 0
    stamp: int = 0
    unmeasured_s2: float = 0.0
    first: int = 0
    ended: int = 0

    def turn(self, stamp: int) -> tuple[Tick, float | None]:
        """The tick of an image, and the seconds since the one before; None at the first of a log."""
        first = self.ticks == 0 or stamp <= self.stamp
        if first and self.ticks:
            self.log += 1
            self.first -= self.stamp - stamp
            self.ended -= (self.stamp - stamp) * (self.ended > 0)
        seconds = None if first else (stamp - self.stamp) / 1e9
        tick = Tick(index=self.ticks, stamp=stamp, log=self.log, frame=self.ticks, first_of_log=first)
        self.ticks, self.stamp, self.first = self.ticks + 1, stamp, self.first or stamp
        return tick, seconds

    def move(self, frame: Frame, seconds: float | None) -> Motion | None:
        """Go on by a frame's odometry, `seconds` after the one before; gives the motion, None at the first of a log."""
        assert frame.odometry is not None  # an image that odometry does not reach is no tick
        before = np.array([self.x, self.y, self.heading])
        unmeasured_s = math.sqrt(abs(frame.unmeasured_s2 - self.unmeasured_s2))
        self.x, self.y, self.heading = frame.odometry.tolist()
        self.unmeasured_s2 = frame.unmeasured_s2
        return None if seconds is None else motion_of(between(before, frame.odometry), unmeasured_s)


class LiveSource(Source):
    """A robot that runs now, over ROS 2: one tick for the newest image whose stamp is between two odometry messages.

    Or a camera that is plugged into this computer: it gives images alone. Without odometry, turns are those that a
    visual compass sees, and the speed is a guess (`speed_m_s`), as of a video.

    Images that were overtaken are counted and never queued. Whatever a tick was made of is written to
    `live.mcap` in the run's folder, as it came: the same graph over that file (`log=live.mcap`) gives the same bytes.
    A run that was killed and is resumed first makes the ticks again that its record holds, then joins the robot.

    It ends with Ctrl-C or SIGTERM, as a log does at its last image. A topic that is missing, silent or of another type,
    a QoS that does not fit and clocks that jump are reported on the terminal and in diagnostics, and waited out. Raises
    `TransportError` where the transport's library is missing, `BadInput` where the camera cannot be its images'.
    """

    repeatable: ClassVar[bool] = False

    log: str | None = LIVE
    """`live`: a robot over ROS 2. `camera:0`: a camera by its number, or by its file as camera:/dev/video0."""
    speed_m_s: Annotated[float, Bounds(ge=0, le=100)] | None = None
    """The guessed speed of a robot without odometry; then none is read. It may be off by as much, or by 0.5 m/s where
    that is more. Null: odometry is waited for."""
    transport: TransportName = "dds"
    """`dds` needs no ROS: CycloneDDS. `rclpy` needs a sourced ROS 2, and answers services too."""
    domain: Annotated[int, Bounds(ge=0, le=232)] | None = None
    """The ROS domain; null: `ROS_DOMAIN_ID`, else 0."""
    topics: Topics = Topics()
    """Which topics are read. An image topic whose name ends with `compressed` carries compressed images."""
    map_frame: str = "map"
    """The map's frame: goals and poses that are given from outside in another one are refused."""
    initial_pose: str | None = "/initialpose"
    """Topic for the robot's pose, given from outside (PoseWithCovarianceStamped): the belief starts again there."""
    goal: str | None = GOAL_TOPIC
    """Topic for its goal (PoseStamped)."""
    restart: str | None = "/reinitialize_global_localization"
    """Topic (Empty), and service of that name where the transport has services: the belief starts again, uniform."""
    amcl: str | None = None
    """The name of nav2's AMCL node, to answer its other services too, where the transport has services."""
    camera: str | None = None
    """A camera.yaml, or a projection (`equirectangular`, …); null: the robot's CameraInfo, which is waited for."""
    limits: MotionLimits = MotionLimits()
    """Limits of the robot: odometry and truth beyond it are doubted until they have gone on so for a second."""
    diagnostics: str | None = "/diagnostics"
    """Topic on which the state of the run is published every second (DiagnosticArray)."""
    seconds: Annotated[float, Bounds(gt=0)] | None = None
    """Ends after this time by the images' stamps; null: only when it is stopped."""
    rest_s: Annotated[float, Bounds(ge=0)] | None = None
    """Ends this long after the planned route has: the robot has arrived, or given up; null: it waits for a new goal."""

    class Out(DriveOutputs):
        """Inputs known at an image. `reported_odometry`: in the frame that the robot's odometry has now, which begins
        again where it is reset; None where motion is guessed."""

        reported_odometry: Pose | None = None

    def check(self, ctx: Context) -> None:
        """Refuse a variant that needs odometry, where there is none and no speed is stated; and what is not there."""
        if self._odometry_topic() is None:
            self._assumed_speed(ctx)
        self._roles(ctx.is_read("scan"))
        self._connect()

    def setup(self, ctx: Context) -> None:
        """Join the domain, so that endpoints match while the rest is made ready; find what was recorded before."""
        device = self._device()
        roles = self._roles(ctx.is_read("scan")) if device is None else dict[str, Role]({TOPIC: "image"})
        self._header = LiveHeader(roles, self.limits)
        self._compass = VisualCompass()
        self._speed = self._assumed_speed(ctx) if self._odometry_topic() is None else None
        ctx.fact("odometry", "measured" if self._speed is None else "guessed")
        self._transport, assumed = self._connect()
        if assumed:
            ctx.warn(f"assumed: {assumed}")
        self._path = None if ctx.folder is None else ctx.folder / RECORD
        self._before = None if self._path is None else _recorded(self._path)
        self._synchronizer: TimeSynchronizer | None = None
        self._record: DriveRecord | None = None
        self._counted: Counter[str] = Counter()
        self._stop, self._handlers = threading.Event(), dict[int, Any]()
        self._watched = 0.0

    def step(
        self,
        ctx: Context,
        position: LiveSourceState,
        command: Command | None = None,
        route: PlannedRoute | None = None,
    ) -> Out | None:
        """The next tick, once there is one; None when the run is to end. `command` is sent elsewhere."""
        again = self._again(position)
        if again is not None:
            return self._out(position, *again)
        synchronizer = self._synchronizer = self._synchronizer or self._join(position)
        while not self._ends(position, route):
            synced = synchronizer.next(0.1)
            self._watch(ctx, synchronizer)
            if synced is not None:
                if synchronizer.mounted is not None and not position.ticks:
                    said, unsaid = synchronizer.mounted.in_words, synchronizer.mounted.unsaid(self._camera is None)
                    if said:
                        ctx.fact("camera_mounted", said)
                    if unsaid:
                        ctx.warn(f"assumed: {self.topics.camera_info}: {unsaid}")
                self._write(synchronizer, synced.messages)
                assert isinstance(synchronizer.camera, Camera)
                return self._out(position, synced.stamp, synchronizer.camera, synced.pixels, synced.frame)
            if len(synchronizer.unrecorded) > 256 and self._record is not None:
                self._write(synchronizer, synchronizer.recordable())
        synchronizer.watch()
        self._leave(ctx, synchronizer)
        if not position.ticks:
            raise BadInput(f"no image became a tick: {self._why_not(synchronizer)}")
        return None

    def _again(self, position: LiveSourceState) -> tuple[int, Camera, Pixels, Frame] | None:
        """The next tick of what was recorded before this process; None where it has all been."""
        before = self._before
        if before is None or position.ticks >= len(before.stamps):
            return None
        pixels = before.image(position.ticks)
        if pixels is None:
            raise UnreadableRecording(f"{before.name}: its image {position.ticks} is damaged; start a new run")
        return int(before.stamps[position.ticks]), before.camera, pixels, before.frame(position.ticks)

    def _join(self, position: LiveSourceState) -> TimeSynchronizer:
        """Subscribe, and let signals end the run well."""
        before, self._before = self._before, None
        if position.ticks > (0 if before is None else len(before.stamps)):
            raise UnreadableRecording(f"{self._path}: it holds fewer ticks than the run made; start a new run")
        synchronizer = TimeSynchronizer(
            transport=self._transport,
            status=self._transport.status,
            header=self._header,
            drive=OdometryBuffer(self._header) if before is None else before.drive,
            camera=self._camera if before is None else before.camera,
            camera_info=None if self.topics.camera_info is None else full_name(self.topics.camera_info),
            patience_s=PATIENCE_S,
            last_stamp=position.stamp if position.ticks else None,
            map_frame=self.map_frame,
        )
        synchronizer.subscribe()
        self._watched = time.monotonic()  # endpoints need a moment to find each other
        self._transport.status.live = True
        if self.restart is not None:
            serve_restart(self._transport, self.restart)
        if self.amcl is not None:
            serve_amcl(self._transport, self.amcl, self.initial_pose)
        if threading.current_thread() is threading.main_thread():
            for number in (signal.SIGINT, signal.SIGTERM):
                self._handlers[number] = signal.signal(number, lambda *_: self._told_to_stop())
        return synchronizer

    def _told_to_stop(self) -> None:
        self._stop.set()
        self._give_signals_back()  # a second signal terminates at once

    def _give_signals_back(self) -> None:
        while self._handlers:
            signal.signal(*self._handlers.popitem())

    def _ends(self, position: LiveSourceState, route: PlannedRoute | None) -> bool:
        if self._stop.is_set() or self._transport.ended:
            return True
        ended = route is not None and route.state in ("arrived", "gave up")
        position.ended = (position.ended or position.stamp) if ended else 0
        if self.rest_s is not None and position.ended and position.stamp - position.ended >= self.rest_s * 1e9:
            return True
        return self.seconds is not None and position.stamp - position.first >= self.seconds * 1e9

    def _leave(self, ctx: Context, synchronizer: TimeSynchronizer) -> None:
        self._count_losses(ctx, synchronizer)
        if gap := synchronizer.gap():
            ctx.warn(gap)
        status = self._transport.status
        if status.latencies_ms is not None:
            ctx.fact("latency_ms_median", round(status.latencies_ms[0], 1), of_run=True)
            ctx.fact("latency_ms_p95", round(status.latencies_ms[1], 1), of_run=True)
            ctx.fact("rate_hz", round(status.rate_hz, 2), of_run=True)
        if status.age_ms is not None:
            ctx.fact("age_ms_median", round(status.age_ms, 1), of_run=True)
        self._write(synchronizer, synchronizer.recordable())
        if self._record is not None:
            self._record.close()
        self._give_signals_back()
        disconnect()

    def _why_not(self, synchronizer: TimeSynchronizer) -> str:
        """Inputs that were missing, as the terminal reported, and what was left out."""
        troubles = sorted(self._transport.status.troubles.values())
        for kind, number in self._counted.items():
            troubles.append(f"{kind} {number} times ({synchronizer.first_dropped(kind) or kind:.200})")
        return "; ".join(troubles) or "it was ended before the first image; let it run until the robot sends"

    def _write(self, synchronizer: TimeSynchronizer, messages: list[Any]) -> None:
        if self._path is None or not isinstance(synchronizer.camera, Camera) or not synchronizer.camera.complete:
            return
        if self._record is None:
            self._record = DriveRecord(self._path, self._header, synchronizer.camera)
        self._record.write(messages)

    def _watch(self, ctx: Context, synchronizer: TimeSynchronizer) -> None:
        """Every second, report how it goes."""
        now = time.monotonic()
        if now - self._watched < WATCH_S:
            return
        self._watched = now
        synchronizer.watch()
        self._count_losses(ctx, synchronizer)
        status = self._transport.status
        news = status.news()
        for sentence in news:
            ctx.warn(sentence)
        ctx.status(", ".join([status.line(), *news]))
        if self.diagnostics is not None:
            publish_diagnostics(self._transport, self.diagnostics)

    def _count_losses(self, ctx: Context, synchronizer: TimeSynchronizer) -> None:
        """Count in the manifest what was left out since the last time."""
        counts = synchronizer.dropped()
        for kind, number in (counts - self._counted).items():
            ctx.count(kind, number, synchronizer.first_dropped(kind))
        self._counted = counts

    def _out(self, position: LiveSourceState, stamp: int, camera: Camera, pixels: Pixels, frame: Frame) -> Out:
        image = Image(pixels)
        tick, since = position.turn(stamp)
        if self._speed is None:
            pose, motion = Pose, position.move(frame, since)
        else:
            if since is None:
                position.x = position.y = position.heading = 0.0
            pose, motion = AssumedPose, dead_reckon(self._compass, self._speed, position, image, camera, since)
        return self.Out(
            tick=tick,
            image=image,
            camera=camera,
            motion=motion,
            odometry=pose(position.x, position.y, position.heading),
            reported_odometry=pose_of(frame.reported_odometry),
            truth=pose_of(frame.truth),
            scan=frame.scan,
            restart=frame.restart,
            goal=frame.goal,
        )

    def _device(self) -> str | None:
        """The camera of this computer that takes the robot's place; None: a robot does. Raises `BadInput`."""
        log = self.log or LIVE
        if log != LIVE and not log.startswith(DEVICE):
            raise BadInput(
                f"log={log:.100}: what runs now is log=live (a robot over ROS 2) or log=camera:0 (a camera that is "
                f"plugged in); a recorded drive is read without live: omninav log={log:.100}"
            )
        return log.removeprefix(DEVICE) if log.startswith(DEVICE) else None

    def _connect(self) -> tuple[Transport, str]:
        """The transport, and what was assumed of its camera; `_camera` is what is known of that."""
        self._camera: Camera | str | None = self.camera
        device = self._device()
        if device is not None:
            plugged_in = connect_camera(device)
            self._camera, assumed = device_camera(device, self.camera, plugged_in.first)
            return plugged_in, assumed
        if self.camera is not None and (user_path(self.camera).exists() or self.camera not in camera_models()):
            self._camera = read_camera(user_path(self.camera))
        return connect(self.transport, self.domain), ""

    def _odometry_topic(self) -> str | None:
        return self.topics.odometry if self._device() is None and self.speed_m_s is None else None

    def _assumed_speed(self, ctx: Context) -> float:
        name = "the robot" if self._device() is None else f"log={self.log}"
        return assumed_speed(ctx, name, None, self.speed_m_s, has_truth=False)

    def _roles(self, scan: bool) -> dict[str, Role]:
        wanted: list[tuple[str | None, Role]] = [
            *((topic, "image") for topic in ([self.topics.image] if self.topics.image else IMAGE_TOPICS)),
            (self._odometry_topic(), "odometry"),
            (self.topics.truth, "truth"),
            (self.topics.scan if scan else None, "scan"),
            (TF_STATIC if scan and self.topics.scan else None, "transforms"),
            (self.initial_pose, "initial_pose"),
            (self.goal, "goal"),
            (self.restart, "restart"),
        ]
        roles: dict[str, Role] = {}
        for topic, role in wanted:
            name = "" if topic is None else full_name(topic)
            if ":" in name:
                raise BadInput(f"{name}: transforms are read from logs alone; live, publish topics.{role} as messages")
            if name and roles.setdefault(name, role) != role:
                raise BadInput(f"{name}: it cannot be both {roles[name]} and {role}; give one of them its own topic")
        return roles


def _recorded(path: Path) -> LiveRecording | None:
    """The record of an earlier process of this run; None where there is nothing."""
    file = unfinished(path)
    if not file.exists():
        return None
    feed = LogReader(file)
    return LiveRecording(str(file), feed, [file]) if HEADER in feed.topics else None
