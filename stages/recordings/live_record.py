"""Recording of what a live run consumed: an image in it is a tick, made of what is before it in the file."""

import json
from collections import deque
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from omninav.pipeline import convert_fields
from omninav.pipeline.mcap.message import BadMessage, Record
from omninav.stages.camera.model import Camera
from omninav.stages.geometry.arrays import Array
from omninav.stages.values.commands import GoalPoint, Reinitialise
from omninav.stages.values.scan import Scan

from .camera_yaml import parse_camera
from .live_track import LiveTrack
from .messages import pose_of, scan_of
from .placed_scan import placed_scan
from .plausibility import MotionLimits
from .recording import UnreadableRecording
from .static_transforms import StaticTransforms
from .topic_recording import STALE, Feed, TopicRecording

Role = Literal["image", "odometry", "truth", "scan", "initial_pose", "goal", "restart", "transforms"]
HEADER, HEADER_TYPE = "/omninav/live", "std_msgs/msg/String"
"""The topic that makes a file a live record: its one message states what the others are."""
CAMERA = "camera.yaml"
SCANS = 64
"""Range readings that are kept for images that come late."""


@dataclass(frozen=True)
class LiveHeader:
    """`topics`: name -> role. `limits`: what the robot was believed to be able to do."""

    topics: dict[str, Role]
    limits: MotionLimits = field(default_factory=MotionLimits)

    def text(self) -> str:
        """As the message holds it."""
        return json.dumps(asdict(self), sort_keys=True)


def read_header(feed: Feed, name: str) -> LiveHeader:
    """The header of a live record. Raises `UnreadableRecording` where it cannot be understood."""
    content = None
    try:
        record = next(iter(feed.scan({HEADER})), None)
        if record is not None:
            content = json.loads(feed.decode(HEADER, record.data).data)
    except (BadMessage, ValueError, RecursionError, AttributeError):
        pass
    fields, problems = convert_fields(content if isinstance(content, dict) else {}, LiveHeader, "")
    if problems or not fields.get("topics"):
        raise UnreadableRecording(f"{name}: its message on {HEADER} is damaged, or of another version of omninav")
    return LiveHeader(**fields)


class Frame(NamedTuple):
    """All but the image of a tick. Poses are (3,), NaN where `truth` is not known. `odometry` continues over jumps,
    `reported_odometry` is in the frame that the robot's odometry has now."""

    odometry: Array | None
    reported_odometry: Array | None
    unmeasured_s2: float
    truth: Array | None
    scan: Scan | None
    restart: Reinitialise | None
    goal: GoalPoint | None


class OdometryBuffer:
    """Knowledge of a drive from the messages that have come, in the order in which they came."""

    def __init__(self, header: LiveHeader) -> None:
        roles = header.topics.values()
        self.odometry = LiveTrack(header.limits, jumps=False) if "odometry" in roles else None
        self.truth = LiveTrack(header.limits, jumps=True) if "truth" in roles else None
        self.fixed, self.base = StaticTransforms(), ""
        """Static transforms, and the robot's frame as the first odometry names it."""
        self._scans: deque[tuple[int, Scan, str, Any]] = deque(maxlen=SCANS)
        self._restart: Reinitialise | None = None
        self._goal: GoalPoint | None = None

    def add(self, role: Role, stamp: int, message: Any, item: Any = None) -> list[Any]:
        """Take a decoded message. Returns the items of messages that are now used: a replay needs them, in that order.

        Raises ValueError or AttributeError where the message cannot be of its role.
        """
        if role == "odometry" and self.odometry is not None:
            used = self.odometry.add(stamp, pose_of(message), item)
            self.base = self.base or (message.child_frame_id if used else "")
            return used
        if role == "truth" and self.truth is not None:
            return self.truth.add(stamp, pose_of(message), item)
        if role == "scan":
            self._scans.append((stamp, scan_of(message), message.header.frame_id, item))
            return []
        if role == "goal":
            x, y, _ = pose_of(message)
            self._goal = GoalPoint(x, y)
        elif role == "restart":
            self._restart = Reinitialise()
        elif role == "initial_pose":
            self._restart = Reinitialise(_start_of(message))
        elif role == "transforms":
            self.fixed.add(message)
        return [item]

    def frame(self, stamp: int) -> tuple[Frame, list[Any]] | None:
        """Inputs of an image, and the items of range readings used; None where odometry does not reach it."""
        odometry = None if self.odometry is None else self.odometry.at(stamp)
        if self.odometry is not None and odometry is None:
            return None
        truth = None if self.truth is None else self.truth.at(stamp)
        used = max((n for n, one in enumerate(self._scans) if 0 <= stamp - one[0] <= STALE), default=None)
        scan, item = None, None
        if used is not None:
            at, scan, frame_id, item = self._scans[used]
            self._scans[used] = (at, scan, frame_id, None)  # once in the record is enough
            scan = placed_scan(scan, self.fixed.scanner(self.base, frame_id))
        frame = Frame(
            odometry=odometry,
            reported_odometry=None if self.odometry is None or odometry is None else self.odometry.reported(odometry),
            unmeasured_s2=0.0 if self.odometry is None else self.odometry.unmeasured_s2(stamp),
            truth=truth if truth is not None or self.truth is None else np.full(3, np.nan),
            scan=scan,
            restart=self._restart,
            goal=self._goal,
        )
        self._restart = self._goal = None
        return frame, [] if item is None else [item]


class LiveRecording(TopicRecording):
    """The record of a live run. Its frames are the run's ticks: nothing is judged again."""

    def __init__(self, name: str, feed: Feed, files: Sequence[Path]) -> None:
        header = read_header(feed, name)
        self._frames: list[Frame] = []
        stamps: list[int] = []
        images: list[Record] = []
        drive = self.drive = OdometryBuffer(header)
        camera = _camera(name, feed)
        for record in feed.scan(set(header.topics)):
            role = header.topics[record.topic]
            if role == "image":
                taken = record.stamp - camera.delay_ns
                made = drive.frame(taken)
                if made is None:
                    feed.drop("outside_odometry", f"{name}: image with stamp {record.stamp} ns has no odometry")
                    continue
                self._frames.append(made[0])
                stamps.append(taken)
                images.append(record._replace(data=b""))
                continue
            try:
                drive.add(role, record.stamp, feed.decode(record.topic, record.data))
            except (BadMessage, ValueError, AttributeError) as error:
                feed.drop("bad_message", f"{name}: a message on {record.topic}: {error!s:.160}")

        frames = self._frames
        odometry = None if drive.odometry is None else np.array([frame.odometry for frame in frames]).reshape(-1, 3)
        super().__init__(
            name=name,
            camera=camera,
            stamps=np.array(stamps, dtype=np.int64),
            odometry=odometry,
            truth=None if drive.truth is None else np.array([frame.truth for frame in frames]).reshape(-1, 3),
            unmeasured_s2=np.array([frame.unmeasured_s2 for frame in frames]),
            feed=feed,
            images=images,
            files=files,
        )

    def scan(self, frame: int) -> Scan | None:
        """The range readings that the tick had."""
        return self._frames[frame].scan

    def frame(self, frame: int) -> Frame:
        """All but the image of a tick."""
        return self._frames[frame]


def _camera(name: str, feed: Feed) -> Camera:
    if CAMERA not in feed.attachments:
        raise UnreadableRecording(f"{name}: its attachment {CAMERA} is missing; give camera=PATH/camera.yaml")
    return parse_camera(feed.attachments[CAMERA], f"{name}: attachment {CAMERA}")


MAX_START_SIGMA = 1e4
"""Largest standard deviation of a first pose (m, rad): a pose of more says nothing."""


def _start_of(message: Any) -> tuple[float, float, float, float, float]:
    """x, y, heading and their standard deviations of a PoseWithCovarianceStamped."""
    x, y, heading = pose_of(message)
    covariance = np.asarray(message.pose.covariance, dtype=np.float64)
    variances = np.array([(covariance[0] + covariance[7]) / 2, covariance[35]])
    if not ((variances >= 0).all() and (variances <= MAX_START_SIGMA**2).all()):
        raise ValueError(f"its covariance is none, or of standard deviations above {MAX_START_SIGMA:g}")
    metres, radians = np.sqrt(variances).tolist()
    return x, y, heading, metres, radians
