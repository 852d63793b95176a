"""Inputs from a robot, put together: the newest image that odometry reaches, and what belongs to it."""

import math
import time
from collections import Counter
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, NamedTuple

from omninav.pipeline import BadInput
from omninav.pipeline.mcap.message_types import header_stamp, standard_types
from omninav.stages.camera.model import Camera
from omninav.stages.recordings.camera_yaml import camera_from_info
from omninav.stages.recordings.live_record import Frame, LiveHeader, OdometryBuffer, Role
from omninav.stages.recordings.messages import IMAGE_TYPES, SCAN_TYPE, TRANSFORMS_TYPE, is_blank, pixels_of
from omninav.stages.recordings.named_camera import named_camera
from omninav.stages.recordings.plausibility import EXCURSION_S
from omninav.stages.recordings.static_transforms import TF_STATIC, Mounted
from omninav.stages.values.encoded_image import Undecodable
from omninav.stages.values.image import Pixels

from .status import LiveStatus
from .transport import RawMessage, Transport, TransportError

CAMERA_INFO = "sensor_msgs/msg/CameraInfo"
EMPTY = "std_msgs/msg/Empty"
POSE_STAMPED = "geometry_msgs/msg/PoseStamped"
POSE_WITH_COVARIANCE = "geometry_msgs/msg/PoseWithCovarianceStamped"
TYPES: dict[Role, str] = {
    "odometry": "nav_msgs/msg/Odometry",
    "truth": POSE_STAMPED,
    "scan": SCAN_TYPE,
    "initial_pose": POSE_WITH_COVARIANCE,
    "goal": POSE_STAMPED,
    "restart": EMPTY,
    "transforms": TRANSFORMS_TYPE,
}
"""Message types of each role's topic; an image's type follows from its topic."""
SETTINGS = {"image": "topics.image", "odometry": "topics.odometry", "scan": "topics.scan"}
"""Settings that name the topics of sensors."""
WITHOUT = {
    "odometry": "speed=0.5 (m/s, a robot without odometry)",
    "scan": "topics.scan=null (a robot without a range finder)",
}
"""Words to type for a robot without the sensor."""
SHARED = (TRANSFORMS_TYPE, "diagnostic_msgs/msg/DiagnosticArray")
"""Types of topics that many nodes publish together."""
SILENT_S = 1.0
"""Silence after which a topic that was heard is reported, seconds."""
MAX_CLOCKS_S = 60.0
"""Difference of the newest stamps of images and odometry beyond which they are of different clocks (s)."""
MAX_BEHIND_S = 1.0
"""Age of an image against odometry above which, once its clock was set back, odometry's was not (s)."""
GAP_S = 5.0
"""Wait for an image of a robot that had sent some above which a run's result tells of it, seconds."""
UNUSED_S = 2.0
"""Images of which none becomes a tick for so long are a trouble."""


class _Pending(NamedTuple):
    stamp: int
    since: float
    message: RawMessage


class SyncedFrame(NamedTuple):
    """A tick's image with all that belongs to it; `messages`: what it consumed, in the order of the record."""

    stamp: int
    pixels: Pixels
    frame: Frame
    messages: list[RawMessage]


@dataclass
class TimeSynchronizer:
    """Joins a transport's images with odometry, scans and truth of their times, and reports what is missing."""

    transport: Transport
    status: LiveStatus
    header: LiveHeader
    drive: OdometryBuffer
    camera: Camera | str | None
    """A projection's name is enough with the first image; None: the robot's CameraInfo does."""
    camera_info: str | None
    patience_s: float
    last_stamp: int | None = None
    """Stamp (ns) of the last image that was used."""
    map_frame: str = "map"
    """Frame of goals and initial poses."""

    def __post_init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self.details: dict[str, str] = {}
        """The first of each kind; `_latest`: the last."""
        self._latest: dict[str, str] = {}
        self.unrecorded: list[RawMessage] = []
        self._images: list[_Pending] = []
        self._image_stamp = -1
        self._earlier: int | None = None
        self._without_scan = False
        self.mounted: Mounted | None = None
        """The camera of the first tick, with what static transforms state of it."""
        self._info_frame = ""
        self._by_info = self.camera is None
        self._since = time.monotonic()
        self._received: dict[str, float] = {}
        self._used_any = self.last_stamp is not None
        self._last_used, self._counts_at_last = self._since, Counter[str]()
        self._waits_since: float | None = math.inf
        self._max_wait = 0.0, 0

    def subscribe(self) -> None:
        """Ask for all topics. Of images, only the newest is kept while nobody takes them."""
        self._since = time.monotonic()
        for topic, role in self.header.topics.items():
            if role != "transforms":
                self.transport.subscribe(topic, type_on(topic, role), newest=role == "image")
        if self.camera is None and self.camera_info is not None:
            self.transport.subscribe(self.camera_info, CAMERA_INFO, newest=True)
        if self._wants_transforms() or TF_STATIC in self.header.topics:
            with suppress(TransportError):  # an installation without that type has no such transforms either
                self.transport.subscribe(TF_STATIC, TRANSFORMS_TYPE, latched=True)

    def next(self, wait_s: float) -> SyncedFrame | None:
        """The newest image that can be used, of all that has come; None where none can within that time."""
        until = time.monotonic() + wait_s
        self._waits_since = until - wait_s if self._waits_since is None else self._waits_since
        while True:
            while (message := self.transport.take()) is not None:
                self._take(message)
            synced = self._newest()
            left = until - time.monotonic()
            if synced is not None or left <= 0:
                return synced
            message = self.transport.take(left)
            if message is not None:
                self._take(message)

    def gap(self) -> str:
        """Sentence on the longest wait for an image since the first one that was used; "" where it was short."""
        self._end_wait()
        seconds, stamp = self._max_wait
        if seconds < GAP_S:
            return ""
        return f"the robot sent no image that could be used for {seconds:.0f} s after that of {stamp / 1e9:.3f} s"

    def _end_wait(self) -> None:
        if self._waits_since is not None:
            self._max_wait = max(self._max_wait, (time.monotonic() - self._waits_since, self.last_stamp or 0))
            self._waits_since = None

    def watch(self) -> None:
        """Note what is missing, and what is well again."""
        now = time.monotonic()
        mismatched = self.transport.mismatched()
        offered = self.transport.offered()
        topics = self.header.topics
        images = [topic for topic, role in topics.items() if role == "image"]
        spoken = [topic for topic in images if topic in self._received]
        image = (spoken or [topic for topic in images if topic in offered] or images)[0]
        kinds = {topic: type_on(topic, role) for topic, role in topics.items() if role != "image" or topic == image}
        needed = {topic for topic in kinds if topics[topic] in SETTINGS}
        if self.camera is None and self.camera_info is not None:
            kinds[self.camera_info] = CAMERA_INFO
            needed.add(self.camera_info)
        for topic in {*images, *kinds, *([self.camera_info] if self.camera_info else [])}:
            kind, heard = kinds.get(topic, ""), self._received.get(topic)
            trouble = ""
            if not kind:
                pass
            elif topic in mismatched:
                trouble = f"{topic}: its {mismatched[topic]} (QoS) does not fit"
            elif topic in offered and offered[topic] != kind:
                trouble = f"{topic} carries {offered[topic]:.80}, not {kind}{self._advice(topic, kind, offered)}"
            elif topic not in needed:
                pass
            elif heard is None:
                trouble = f"nothing on {topic} ({kind}) for {now - self._since:.0f} s"
                trouble += "" if topic in offered else ", nobody publishes it"
                trouble += self._advice(topic, kind, offered)
            elif now - heard > max(SILENT_S, self.patience_s):
                trouble = f"{topic} ({kind}) has been silent for {now - heard:.0f} s"
                trouble += "" if topic in offered else ", nobody publishes it"
            elif topics.get(topic) == "scan" and self._without_scan:
                trouble = f"{topic}: nothing of it is stamped in the second before an image; is its clock the camera's?"
            self.status.note(topic, trouble)
        for topic in self.status.sent:
            other = topic in offered and offered[topic] not in SHARED
            self.status.note(f"sent {topic}", f"another node publishes {topic} too; end one of them" if other else "")
        self.status.counts = self.dropped()
        unseen = f"no publisher is seen ({self.transport.place}): {self.transport.unseen()}"
        self.status.note("robot", "" if offered or self._received else unseen)
        without = [topic for topic in needed if topic in self.status.troubles and topics.get(topic) != "scan"]
        self.status.note("ticks", "" if without else self._unused(now))  # else that is why

    def _advice(self, topic: str, kind: str, offered: Mapping[str, str]) -> str:
        """Say what to type where another topic carries what a sensor should, or the robot has no such sensor."""
        role = self.header.topics.get(topic)
        kinds = IMAGE_TYPES if role == "image" else (kind,)
        others = sorted(
            name for name, carried in offered.items() if carried in kinds and name not in self.header.topics
        )
        if role is not None and role not in SETTINGS:
            return ""
        setting = SETTINGS.get(role or "", "topics.camera_info")
        advice = [f"{setting}={others[0]:.80}"] if others else []
        advice += [WITHOUT[role]] if role in WITHOUT else []
        advice += ["camera=PATH/camera.yaml"] if role is None else []
        return f"; type {', or '.join(advice)}" if advice else ""

    def _unused(self, now: float) -> str:
        """Why no image has become a tick though there are some."""
        unused = self.counts - self._counts_at_last
        unused.pop("overtaken_image", None)
        if not unused or now - self._last_used < UNUSED_S:
            return ""
        track, stamp = self.drive.odometry, self._image_stamp
        last = stamp if track is None or track.last is None else track.last
        is_other = stamp >= 0 and abs(stamp - last) > MAX_CLOCKS_S * 1e9
        if stamp == 0 or (is_other and stamp < 1e9):
            return "images carry no time stamp (0): let the camera's driver set header.stamp"
        if is_other:
            return (
                f"images and odometry are stamped by different clocks ({stamp / 1e9:.3f} s, {last / 1e9:.3f} s): "
                "use one (chrony, PTP; use_sim_time for all nodes or for none)"
            )
        kind, number = unused.most_common(1)[0]
        ahead, advice = (stamp - last) / 1e9, ""
        if kind == "outside_odometry" and abs(ahead) > self.patience_s:
            beside = f"; images are stamped {ahead:+.1f} s from odometry"
            advice = f"{beside}: use one clock, or `delay: {ahead:.1f}` in camera.yaml"
        return f"no image is used: {kind} {number} times ({self._latest.get(kind, kind):.200}){advice}"

    def first_dropped(self, kind: str) -> str:
        """Describes the first item of a kind that was left out."""
        tracks = {"odometry": self.drive.odometry, "truth": self.drive.truth}
        of_tracks = (
            f"{role}: {track.details[kind]}" for role, track in tracks.items() if track and kind in track.details
        )
        return self.details.get(kind) or next(of_tracks, "")

    def dropped(self) -> Counter[str]:
        """Numbers of items left out so far, by kind."""
        tracks = (self.drive.odometry, self.drive.truth)
        found = sum((track.dropped for track in tracks if track is not None), self.counts.copy())
        images = [topic for topic, role in self.header.topics.items() if role == "image"]
        found["overtaken_image"] += sum(self.transport.queue.overtaken[topic] for topic in images)
        return +found

    def _drop(self, kind: str, detail: str) -> None:
        self.counts[kind] += 1
        self.details.setdefault(kind, detail)
        self._latest[kind] = detail

    def _take(self, message: RawMessage) -> None:
        self._received[message.topic] = time.monotonic()
        role = self.header.topics.get(message.topic)
        if role == "image":
            stamp = header_stamp(message.data)
            if stamp is None:
                self._drop("bad_message", f"{message.topic}: a message of {len(message.data)} bytes is no image")
            else:
                self._image_stamp = stamp
                delay = self.camera.delay_ns if isinstance(self.camera, Camera) else 0
                self._images.append(_Pending(stamp - delay, time.monotonic(), message))
            return
        try:
            decoded: Any = standard_types().deserialize_cdr(message.data, message.msgtype)
            if message.topic == TF_STATIC:
                self.unrecorded += [message] if role else []  # even a broken one, whose others hold
                return self.drive.fixed.add(decoded)
            if role is None:
                if self.camera is None:
                    self.camera = camera_from_info(decoded, str(message.topic))
                    self._info_frame = decoded.header.frame_id
                return
            header = getattr(decoded, "header", None)
            if header is not None and role in ("goal", "initial_pose"):
                frame = header.frame_id.lstrip("/")
                told = f"its frame is '{frame}', expected '{self.map_frame}'; in RViz choose it as the fixed frame"
                self.status.note("frame", f"{message.topic}: {told}" if frame not in ("", self.map_frame) else "")
                if frame not in ("", self.map_frame):
                    raise ValueError(told)
            stamp = message.received if header is None else header.stamp.sec * 10**9 + header.stamp.nanosec
            items = self.drive.add(role, stamp, decoded, message)
        except BadInput:
            raise
        except Exception as error:  # damaged bytes raise whatever the generated decoder stumbles over
            self._drop("bad_message", f"{message.topic}: a message is not a valid {message.msgtype} ({error!s:.120})")
            return
        self.unrecorded += items

    def _newest(self) -> SyncedFrame | None:
        """The newest sound image that odometry has reached; older ones are overtaken by it."""
        if self.camera is None:
            self._images.clear()
            return None
        track, now = self.drive.odometry, time.monotonic()
        reached = [one for one in self._images if track is None or (track.last is not None and one.stamp <= track.last)]
        for one in sorted(reached, key=lambda one: one.stamp, reverse=True):
            if self._awaits_truth(one, now):
                return None
            synced = self._use(one, self.camera)
            self._images.remove(one)
            if synced is not None:
                late = [other for other in self._images if other in reached]
                self.counts["overtaken_image"] += len(late)
                self._images = [other for other in self._images if other not in late]
                return synced
        for one in self._images:
            if now - one.since > self.patience_s:
                where = "nothing" if track is None or track.last is None else f"up to {track.last / 1e9:.3f} s"
                self._drop("outside_odometry", f"image of {one.stamp / 1e9:.3f} s: odometry has {where}")
        self._images = [one for one in self._images if now - one.since <= self.patience_s]
        return None

    def _awaits_truth(self, image: _Pending, now: float) -> bool:
        truth = self.drive.truth
        if truth is None or now - image.since > self.patience_s / 2:
            return False
        topic = next(name for name, role in self.header.topics.items() if role == "truth")
        speaks = now - self._received.get(topic, -1e9) < self.patience_s
        return speaks and truth.last is not None and truth.last < image.stamp

    def _wants_transforms(self) -> bool:
        """True until the first tick, if no file states where the camera sits: static transforms may."""
        told = isinstance(self.camera, Camera) and self.camera.placed
        return not self._used_any and not told

    def _awaits_transforms(self) -> bool:
        """True while static transforms that join the camera to the robot may still come."""
        waits = self._wants_transforms() and time.monotonic() - self._since <= self.patience_s
        return waits and self.transport.offered().get(TF_STATIC) == TRANSFORMS_TYPE

    def _use(self, image: _Pending, camera: Camera | str) -> SyncedFrame | None:
        where = f"{image.message.topic}: the image of {image.stamp / 1e9:.3f} s"
        if image.stamp == self.last_stamp:
            self._drop("duplicate_frame", f"{where} has come before")
            return None
        if not self._follows(image.stamp):
            self._drop("backward_stamp", f"{where} comes after one of {(self.last_stamp or 0) / 1e9:.3f} s")
            return None
        try:
            decoded: Any = standard_types().deserialize_cdr(image.message.data, image.message.msgtype)
            pixels = pixels_of(decoded)
        except Undecodable as error:
            self._drop("undecodable_image", f"{where}: {error}")
            return None
        except Exception as error:  # as above
            self._drop("bad_message", f"{where} is not a valid {image.message.msgtype} ({error!s:.120})")
            return None
        if isinstance(camera, str):
            camera = self.camera = named_camera(camera, lambda: pixels.shape[1::-1])[0]
        size = (camera.height_px, camera.width)
        if pixels.shape[:2] != size:
            is_not = f"{pixels.shape[1]} x {pixels.shape[0]}, its camera {size[1]} x {size[0]}"
            if not self._used_any:
                raise BadInput(f"{image.message.topic}: its images are {is_not}; give camera=PATH/camera.yaml")
            self._drop("wrong_size", f"{where} is {is_not}")
            return None
        if is_blank(pixels):
            self._drop("blank_image", f"{where} is blank")
            return None
        whole = camera.found_in(pixels)
        if whole is None:
            self._drop("no_ring_in_image", f"{where} shows no mirror's ring; give centre and mask in camera.yaml")
            return None
        self.camera = whole
        mounted = Mounted(whole)
        if not self._used_any:
            own = self._info_frame or decoded.header.frame_id
            mounted = self.drive.fixed.mounted(whole, self.drive.base, own, self._by_info)
            if not mounted.in_words and self._awaits_transforms():
                return None
        made = self.drive.frame(image.stamp)
        if made is None:
            self._drop("outside_odometry", f"{where}: odometry begins later")
            return None
        if not self._used_any:
            self.mounted = mounted
        self.camera = mounted.camera
        frame, scans = made
        self._without_scan = frame.scan is None
        messages = [*self.recordable(), *scans, image.message]
        self._end_wait()
        self.last_stamp, self._used_any, self._earlier = image.stamp, True, None
        self._last_used, self._counts_at_last = time.monotonic(), self.counts.copy()
        self.status.taken(image.stamp, image.message.received)
        return SyncedFrame(image.stamp, pixels, frame, messages)

    def recordable(self) -> list[RawMessage]:
        """Inputs consumed since this was last asked."""
        messages, self.unrecorded = self.unrecorded, []
        return messages

    def _follows(self, stamp: int) -> bool:
        """Tells whether an image comes after the last one used; or its clock was set back for good."""
        track = self.drive.odometry
        behind = 0.0 if track is None or track.last is None else (track.last - stamp) / 1e9
        if behind <= MAX_BEHIND_S:
            self.status.note("clock", "")
        if self.last_stamp is None or stamp > self.last_stamp:
            return True
        if self._earlier is None or stamp < self._earlier:
            self._earlier = stamp
        if stamp - self._earlier < EXCURSION_S * 1e9:
            return False
        if behind > MAX_BEHIND_S:
            self.status.note(
                "clock",
                f"the camera's clock was set back and odometry's was not: images are {behind:.1f} s behind odometry, "
                "and poses off by what the robot drives in that time; let one clock stamp both (chrony, PTP)",
            )
        return True


def type_on(topic: str, role: Role) -> str:
    """The message type that a topic of that role carries."""
    if role != "image":
        return TYPES[role]
    return IMAGE_TYPES[0 if topic.endswith("compressed") else 1]
