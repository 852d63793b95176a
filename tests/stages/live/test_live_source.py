"""The live source over a transport of the test's own."""

import functools
import math
import os
import resource
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest
from conftest import DRIVE

from omninav.pipeline import Context
from omninav.pipeline.graph.problems import BadInput
from omninav.pipeline.mcap.message_types import header_stamp, make_message, standard_types
from omninav.stages.live.live_source import LiveSource, LiveSourceState
from omninav.stages.live.publish import send
from omninav.stages.live.status import LiveStatus
from omninav.stages.live.time_synchronizer import TimeSynchronizer
from omninav.stages.live.transport import MessageQueue, RawMessage
from omninav.stages.recordings.camera_yaml import UNSAID_BY_INFO, read_camera, write_camera
from omninav.stages.recordings.opening import open_recording
from omninav.stages.recordings.recording import Topics
from omninav.stages.recordings.topics import IMAGE_TOPICS

from .conftest import CAMERA, IMAGE, ODOMETRY, TRUTH, Wire, decode, encode, recorded, replayed, same

POSE, POSE_STAMPED = "geometry_msgs/msg/PoseWithCovarianceStamped", "geometry_msgs/msg/PoseStamped"
COMPRESSED, SCAN = "sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/LaserScan"
NO_SCAN = f"nothing on /scan ({SCAN}) for 0 s, nobody publishes it; "
NO_SCAN += "type topics.scan=null (a robot without a range finder)"


@functools.cache
def _said() -> tuple[RawMessage, ...]:
    whole = recorded(DRIVE)
    return tuple(message for message in whole if message.received < whole[0].received + 20_000_000_000)


def said() -> list[RawMessage]:
    """Messages of the recorded robot's first 20 s, in the order in which they were received."""
    return list(_said())


class Drive:
    """A live source that is stepped; a tick is made as soon as one can be."""

    def __init__(self, folder: Path, state: LiveSourceState | None = None, **parameters: object) -> None:
        self.source = LiveSource(**{"camera": str(CAMERA), "diagnostics": None, **parameters})
        self.ctx, self.folder = Context("source", folder=folder), folder
        self.state = state or LiveSourceState()
        self.source.setup(self.ctx)
        self.outs: list[LiveSource.Out] = []

    @property
    def synchronizer(self) -> TimeSynchronizer:
        """Gives what the stage subscribed to, without a tick."""
        if self.source._synchronizer is None:
            self.source._synchronizer = self.source._join(self.state)
        return self.source._synchronizer

    def feed(self, robot: Wire, messages: list[RawMessage]) -> None:
        """One message after another, and every tick that they lead to."""
        synchronizer = self.synchronizer
        for message in messages:
            if message.topic in synchronizer.header.topics:
                robot.queue.put(message)
            synced = synchronizer.next(0.0)
            if synced is not None:
                with patch.object(synchronizer, "next", return_value=synced):
                    out = self.source.step(self.ctx, self.state)
                assert out is not None
                self.outs.append(out)

    def end(self) -> None:
        """As Ctrl-C ends it."""
        self.source._stop.set()
        assert self.source.step(self.ctx, self.state) is None


def driven(robot: Wire, folder: Path, messages: list[RawMessage], **parameters: object) -> Drive:
    """A drive from its first message to its last, whose record gives the same ticks."""
    drive = Drive(folder, **parameters)
    drive.feed(robot, messages)
    drive.end()
    same(drive.outs, replayed(folder / "live.mcap"))
    return drive


def test_the_record_of_a_live_drive_gives_the_same_ticks_as_the_drive(wire: Wire, tmp_path: Path):
    drive = driven(wire, tmp_path, said())
    assert len(drive.outs) > 5
    assert drive.outs[3].motion is not None


def test_images_that_are_stamped_late_are_of_the_time_at_which_they_were_taken(wire: Wire, tmp_path: Path):
    stamps = [out.tick.stamp for out in driven(wire, tmp_path, said()).outs]
    (tmp_path / "live.mcap").unlink()
    (tmp_path / "camera.yaml").write_text(write_camera(replace(read_camera(CAMERA), delay=0.12)))
    late = driven(wire, tmp_path, said(), camera=str(tmp_path / "camera.yaml")).outs
    assert {out.tick.stamp + 120_000_000 for out in late[1:]} <= set(stamps)


def test_a_mirror_of_which_nothing_is_known_is_recorded_with_the_ring_of_its_first_image(wire: Wire, tmp_path: Path):
    (tmp_path / "camera.yaml").write_text("{projection: donut, image: {width: 280, height: 210}}")
    for camera in ("donut", str(tmp_path / "camera.yaml")):
        drive = driven(wire, tmp_path, said(), camera=camera)
        ring = drive.outs[0].camera.ring
        assert ring == pytest.approx((139.5, 104.5, 15.0, 104.0), abs=3.0)
        assert replayed(tmp_path / "live.mcap")[0].camera.ring == ring
        (tmp_path / "live.mcap").unlink()


def test_a_pose_and_a_goal_that_somebody_names_are_in_the_record_at_the_tick_that_had_them(wire: Wire, tmp_path: Path):
    messages = said()
    where = {"pose": {"pose": {"position": {"x": 1.5}, "orientation": {"w": 1.0}}, "covariance": np.full(36, 0.25)}}
    goal = {"pose": {"position": {"x": 3.0, "y": -1.0}, "orientation": {"w": 1.0}}}
    refused = {"header": {"frame_id": "base_link"}, **goal}
    half = len(messages) // 2
    messages[half:half] = [
        RawMessage("/initialpose", POSE, messages[half].received, encode(POSE, where, 0)),
        RawMessage("/goal_pose", POSE_STAMPED, messages[half].received, encode(POSE_STAMPED, goal, 0)),
        RawMessage("/goal_pose", POSE_STAMPED, messages[half].received, encode(POSE_STAMPED, refused, 0)),
    ]
    drive = driven(wire, tmp_path, messages)
    asked = [out for out in drive.outs if out.restart is not None or out.goal is not None]
    assert [out.restart.at for out in asked if out.restart] == [(1.5, 0.0, 0.0, 0.5, 0.5)]
    assert [(out.goal.x, out.goal.y) for out in asked if out.goal] == [(3.0, -1.0)]
    assert drive.ctx.counts["bad_message"] == 1


@pytest.mark.parametrize(("frame", "is_taken"), [("", True), ("/hall", True), ("map", False), ("odom", False)])
def test_a_goal_in_another_frame_than_the_map_s_is_refused_and_noted(
    wire: Wire, tmp_path: Path, frame: str, is_taken: bool
):
    goal = {"header": {"frame_id": frame}, "pose": {"position": {"x": 3.0}, "orientation": {"w": 1.0}}}
    first, messages = RawMessage("/goal_pose", POSE_STAMPED, 0, encode(POSE_STAMPED, goal, 0)), said()
    drive = driven(wire, tmp_path, [first, *messages[: len(messages) // 2]], map_frame="hall")
    assert sum(out.goal is not None for out in drive.outs) == is_taken
    assert ("frame" in wire.status.troubles) == (not is_taken)


def test_a_run_that_was_killed_makes_its_ticks_again_and_goes_on(wire: Wire, tmp_path: Path):
    messages = said()
    drive = Drive(tmp_path)
    drive.feed(wire, messages[: len(messages) // 2])
    done = len(drive.outs)
    assert done > 2
    state = LiveSourceState()  # of a checkpoint before the first tick: all ticks are made again
    wire.queue = MessageQueue()
    resumed = Drive(tmp_path, state)
    again = [resumed.source.step(resumed.ctx, state) for _ in range(done)]
    same(drive.outs, [out for out in again if out is not None])  # type: ignore[misc]
    resumed.feed(wire, messages[len(messages) // 2 :])
    resumed.end()
    assert resumed.outs[0].motion is not None
    assert not resumed.outs[0].tick.first_of_log
    same([*drive.outs, *resumed.outs], replayed(tmp_path / "live.mcap"))
    assert sorted(os.listdir(tmp_path)) == ["live.mcap"]


def cut(message: RawMessage, length: int) -> RawMessage:
    return message._replace(data=message.data[:length])


def zeros(message: RawMessage, start: int) -> RawMessage:
    return message._replace(data=message.data[:start].ljust(len(message.data), b"\0"))


def without_angles(message: RawMessage, ranges: int) -> RawMessage:
    fields = {"angle_increment": 0.0, "range_max": 4.0, "ranges": np.ones(ranges, np.float32)}
    return message._replace(data=encode(SCAN, fields, message.received))


@pytest.mark.parametrize(
    ("msgtype", "spoilt", "number", "kind"),
    [
        (COMPRESSED, cut, 40, "bad_message"),
        (COMPRESSED, cut, 7, "bad_message"),  # shorter than a header
        (COMPRESSED, zeros, 200, "undecodable"),
        (SCAN, without_angles, 60, "bad_message"),
    ],
)
def test_a_damaged_message_is_counted_and_the_drive_goes_on(
    wire: Wire, tmp_path: Path, msgtype: str, spoilt: Callable[[RawMessage, int], RawMessage], number: int, kind: str
):
    messages = said()
    fifth = [row for row, each in enumerate(messages) if each.msgtype == msgtype][4]
    messages[fifth] = spoilt(messages[fifth], number)
    drive = driven(wire, tmp_path, messages)
    assert any(name.startswith(kind) for name in drive.ctx.counts), drive.ctx.counts
    assert len(drive.outs) > 5


def test_images_of_another_size_are_refused_at_the_start_and_counted_later(wire: Wire, tmp_path: Path):
    small = {"height": 2, "width": 2, "encoding": "mono8", "step": 2, "data": np.array([0, 90, 120, 250], np.uint8)}
    odometry = [message for message in said() if message.topic == ODOMETRY]
    last = max(header_stamp(message.data) for message in odometry)
    image = RawMessage("/camera/image", "sensor_msgs/msg/Image", last, encode("sensor_msgs/msg/Image", small, last))
    with pytest.raises(BadInput, match=r"/camera/image: its images are 2 x 2, its camera .*; give camera="):
        Drive(tmp_path).feed(wire, [*odometry, image])
    wire.queue = MessageQueue()
    assert driven(wire, tmp_path, [*said(), image]).ctx.counts["wrong_size"] == 1


def test_while_a_robot_says_nothing_what_is_missing_is_noted(wire: Wire, tmp_path: Path):
    drive = Drive(tmp_path)
    drive.synchronizer.watch()
    assert wire.status.troubles == {
        ODOMETRY: "nothing on /odom (nav_msgs/msg/Odometry) for 0 s, nobody publishes it; "
        "type speed=0.5 (m/s, a robot without odometry)",
        IMAGE: f"nothing on {IMAGE} ({COMPRESSED}) for 0 s, nobody publishes it",
        "/scan": NO_SCAN,
        "robot": "no publisher is seen (a test): is the robot on, and in the same domain and reach?",
    }
    drive.feed(wire, said())
    drive.synchronizer.watch()
    assert not wire.status.troubles


@pytest.mark.parametrize(("seconds", "told"), [(12.0, True), (2.0, False)])
def test_a_robot_that_fell_silent_is_in_the_result(
    wire: Wire, tmp_path: Path, now: list[float], seconds: float, told: bool
):
    drive = Drive(tmp_path)
    drive.feed(wire, said())
    drive.synchronizer.next(0.0)
    now[0] += seconds
    drive.end()
    assert any("sent no image that could be used for 12 s after that of" in line for line in drive.ctx.warnings) == told


def test_what_is_missing_is_looked_for_under_other_names_and_since_when_is_said(
    wire: Wire, tmp_path: Path, now: list[float]
):
    synchronizer = Drive(tmp_path).synchronizer
    wire.there = {
        "/wheels": "nav_msgs/msg/Odometry",
        "/omni": "sensor_msgs/msg/Image",
        "/camera/image": "std_msgs/msg/String",
    }
    now[0] += 12.0
    synchronizer.watch()
    assert wire.status.troubles == {
        ODOMETRY: "nothing on /odom (nav_msgs/msg/Odometry) for 12 s, nobody publishes it; "
        "type topics.odometry=/wheels, or speed=0.5 (m/s, a robot without odometry)",
        "/camera/image": "/camera/image carries std_msgs/msg/String, not sensor_msgs/msg/Image; "
        "type topics.image=/omni",
        "/scan": NO_SCAN.replace("0 s", "12 s"),
    }


def test_a_camera_info_that_came_late_is_no_trouble_any_more_and_hides_no_other(
    wire: Wire, tmp_path: Path, now: list[float]
):
    synchronizer = Drive(tmp_path, camera=None, topics=Topics(scan=None)).synchronizer
    synchronizer.watch()
    assert "nothing on /camera/camera_info" in wire.status.troubles["/camera/camera_info"]
    (odometry, *_), (image, *_) = recorded(DRIVE, ODOMETRY), recorded(DRIVE, IMAGE)
    wire.queue.put(recorded(DRIVE, "/camera/camera_info")[0])
    assert synchronizer.next(0.0) is None
    wire.status.note("state", "searching")
    for _ in range(2):
        now[0] += 3.0
        wire.queue.put(odometry)
        wire.queue.put(image._replace(data=image.data[:4]))
        assert synchronizer.next(0.0) is None
    synchronizer.watch()
    assert wire.status.troubles.keys() == {"state", "ticks"}
    assert "no image is used: bad_message" in wire.status.troubles["ticks"]


def test_a_range_finder_that_is_missing_and_a_request_of_another_type_are_noted_though_ticks_go_on(
    wire: Wire, tmp_path: Path, now: list[float]
):
    drive = Drive(tmp_path)
    drive.feed(wire, said())
    wire.there = {"/goal_pose": "geometry_msgs/msg/Point", "/pose": POSE_STAMPED, "/odom": "nav_msgs/msg/Odometry"}
    wire.there |= {IMAGE: COMPRESSED}
    drive.synchronizer.watch()
    assert drive.outs
    assert wire.status.troubles == {"/goal_pose": f"/goal_pose carries geometry_msgs/msg/Point, not {POSE_STAMPED}"}
    drive.synchronizer._received.pop("/scan")
    wire.there["/base_scan"] = SCAN
    drive.synchronizer.watch()
    assert wire.status.troubles["/scan"] == NO_SCAN.replace("type", "type topics.scan=/base_scan, or")


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"topics": Topics(image="/odom")}, "/odom: it cannot be both image and odometry; give"),
        ({"topics": Topics(truth="/odom")}, "/odom: it cannot be both odometry and truth; give"),
        ({"topics": Topics(image="a b")}, "'a b': no topic has such a name; type one as /camera/image"),
        ({"goal": "/initialpose"}, "/initialpose: it cannot be both initial_pose and goal; give"),
        (
            {"topics": Topics(odometry="/tf:odom:base_link")},
            "/tf:odom:base_link: transforms are read from logs alone; live",
        ),
    ],
)
def test_a_topic_for_two_things_or_of_transforms_is_refused_before_anything_runs(
    wire: Wire, given: dict[str, object], said: str
):
    with pytest.raises(BadInput, match=said):
        LiveSource(camera=str(CAMERA), **given).check(Context("source"))


@pytest.mark.parametrize(
    ("by_s", "said"),
    [
        (40, "no image is used: outside_odometry"),
        (40, "odometry has up to"),
        (40, "use one clock, or `delay: "),
        (1000, "are stamped by different clocks"),
        (0, "images carry no time stamp (0)"),
    ],
)
def test_images_that_odometry_never_reaches_are_a_trouble(
    wire: Wire, tmp_path: Path, now: list[float], by_s: int, said: str
):
    synchronizer = Drive(tmp_path).synchronizer
    images = [each._replace(data=ahead(each.data, by_s)) for each in recorded(DRIVE, IMAGE)]
    odometry = recorded(DRIVE, ODOMETRY)
    for late in (False, True):  # both go on coming
        now[0] += 3.0 * late
        for message in (*odometry[late::2], *images[late::2]):
            wire.queue.put(message)
        assert synchronizer.next(0.0) is None
    synchronizer.watch()
    assert said in wire.status.troubles["ticks"]


def ahead(data: bytes, by_s: int) -> bytes:
    """A message whose stamp is so much later; 0: whose stamp is 0."""
    seconds = int.from_bytes(data[4:8], "little") + by_s if by_s else 0
    return data[:4] + seconds.to_bytes(4, "little") + data[8:]


def test_an_image_waits_for_truth_half_as_long_as_for_odometry(wire: Wire, tmp_path: Path, now: list[float]):
    synchronizer = Drive(tmp_path).synchronizer
    image = recorded(DRIVE, IMAGE)[3]
    stamp = header_stamp(image.data)
    for message in [*recorded(DRIVE, ODOMETRY, TRUTH)[:400], image]:
        if message.topic != TRUTH or header_stamp(message.data) < stamp:
            wire.queue.put(message)
    assert synchronizer.next(0.0) is None  # its truth may still come
    now[0] += 0.45
    assert synchronizer.next(0.0) is None
    now[0] += 0.1
    synced = synchronizer.next(0.0)
    assert synced is not None
    assert (synced.stamp, bool(np.isnan(synced.frame.truth).all())) == (stamp, True)


def test_a_run_without_a_tick_is_refused_with_what_was_missing(wire: Wire, tmp_path: Path):
    missing = rf"no image became a tick: no publisher .*; nothing on {IMAGE} .*; nothing on /odom"
    with pytest.raises(BadInput, match=missing):
        Drive(tmp_path).end()


def test_a_run_without_a_tick_says_what_was_left_out_though_the_robot_fell_silent(wire: Wire, tmp_path: Path):
    drive = Drive(tmp_path)
    drive.feed(wire, [each._replace(data=each.data[:90]) if each.topic == IMAGE else each for each in said()])
    with pytest.raises(BadInput, match=r"no image became a tick: .*bad_message \d+ times \(.*is not a valid"):
        drive.end()


def test_a_camera_s_clock_that_alone_is_set_back_is_noted(wire: Wire, tmp_path: Path):
    drive, messages = Drive(tmp_path), said()
    half, end = len(messages) // 2, len(messages) * 3 // 4
    drive.feed(wire, [*messages[:half], *map(set_back, messages[half:end])])
    assert "images are 5." in wire.status.troubles["clock"]
    assert drive.synchronizer.counts["backward_stamp"] > 0
    drive.feed(wire, [set_back(each, IMAGE, ODOMETRY) for each in messages[end:]])
    assert "clock" not in wire.status.troubles  # of odometry too


def set_back(message: RawMessage, *topics: str) -> RawMessage:
    """A message whose stamp is 5 s earlier where it is of these topics, of images without any."""
    if message.topic not in (topics or (IMAGE,)):
        return message
    seconds = int.from_bytes(message.data[4:8], "little") - 5
    return message._replace(data=message.data[:4] + seconds.to_bytes(4, "little") + message.data[8:])


def test_latency_is_measured_from_the_arrival_and_a_clock_that_is_off_shows_as_age():
    status = LiveStatus()
    status.taken(5, time.time_ns() - 20_000_000)
    status.published(5)  # its stamp is of 1970
    assert status.latencies_ms is not None
    assert 20.0 <= status.latencies_ms[0] < 2000.0
    assert status.age_ms is not None
    assert status.age_ms > 1e12


def test_requests_that_are_turned_off_are_not_heard(wire: Wire, tmp_path: Path):
    assert Drive(tmp_path, initial_pose=None, goal=None, restart=None).synchronizer.header.topics.keys() == {
        *IMAGE_TOPICS,
        ODOMETRY,
        TRUTH,
        "/scan",
        "/tf_static",
    }


def test_the_yaw_that_a_camera_info_does_not_say_is_said_to_be_assumed(wire: Wire, tmp_path: Path):
    drive = Drive(tmp_path, camera=None)
    assert drive.synchronizer.camera is None
    wire.queue.put(recorded(DRIVE, "/camera/camera_info")[0])
    drive.feed(wire, said())
    assert drive.ctx.warnings == [f"assumed: /camera/camera_info: {UNSAID_BY_INFO}"]


def test_static_transforms_say_where_the_camera_sits_and_the_record_keeps_it(wire: Wire, tmp_path: Path):
    kind = "tf2_msgs/msg/TFMessage"
    at = {"translation": {"x": 0.2, "y": -0.1, "z": 0.9}, "rotation": {"z": math.sqrt(0.5), "w": math.sqrt(0.5)}}
    fixed = {"header": {"frame_id": "base_link"}, "child_frame_id": "omni_camera", "transform": at}
    told = RawMessage("/tf_static", kind, 0, encode(kind, {"transforms": [fixed]}))
    drive = Drive(tmp_path, camera=None)
    assert drive.synchronizer.camera is None
    wire.there["/tf_static"] = kind  # it is waited for
    wire.queue.put(recorded(DRIVE, "/camera/camera_info")[0])
    elsewhere = {**fixed, "header": {"frame_id": "base_footprint"}, "child_frame_id": "base_link"}
    wire.queue.put(told._replace(data=encode(kind, {"transforms": [elsewhere]})))  # says nothing of the camera
    drive.feed(wire, said()[:60])
    assert not drive.outs
    wire.queue.put(told)
    drive.feed(wire, said()[60:])
    assert drive.outs[0].camera.mount == pytest.approx([0.2, -0.1, math.pi / 2])
    assert not drive.ctx.warnings
    assert "by /tf_static" in drive.ctx.facts["camera_mounted"]
    drive.end()
    assert replayed(tmp_path / "live.mcap")[0].camera.mount == pytest.approx([0.2, -0.1, math.pi / 2])


def test_a_scan_is_turned_as_its_frame_sits_on_the_robot_also_in_the_record(wire: Wire, tmp_path: Path):
    kind, messages = "tf2_msgs/msg/TFMessage", said()
    place = {"translation": {"x": 0.0}, "rotation": {"z": 1.0, "w": 0.0}}
    fixed = {"header": {"frame_id": "base_link"}, "child_frame_id": "laser", "transform": place}
    broken = {**fixed, "child_frame_id": "base_link"}
    told = RawMessage("/tf_static", kind, messages[0].received, encode(kind, {"transforms": [broken, fixed]}))
    for number, each in enumerate(messages):
        if each.topic == "/scan":
            fields = {"ranges": [1.0, 2.0], "angle_increment": 0.1, "range_max": 4.0, "header": {"frame_id": "laser"}}
            content = make_message(SCAN, fields)
            content.header.stamp = decode(SCAN, each.data).header.stamp
            messages[number] = each._replace(data=bytes(standard_types().serialize_cdr(content, SCAN)))
    half = len(messages) // 2
    drive = driven(wire, tmp_path, [*messages[:half], told, *messages[half:]])
    firsts = [out.scan.first for out in drive.outs if out.scan is not None]
    assert (firsts[0], firsts[-1]) == (0.0, pytest.approx(math.pi))
    record = open_recording(str(tmp_path / "live.mcap"))
    assert [found.first for frame in range(len(record.stamps)) if (found := record.scan(frame))] == firsts


def test_a_record_on_a_full_disk_names_its_file(wire: Wire, tmp_path: Path):
    drive = Drive(tmp_path)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, before[1]))
    try:
        with pytest.raises(OSError, match=r"live\.mcap\.unfinished"):
            drive.feed(wire, said())
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_topics_without_a_slash_are_those_that_ros_makes_of_them(wire: Wire, tmp_path: Path):
    names = Topics(image="camera/image/compressed", camera_info="camera/camera_info", odometry="odom", scan="scan")
    source = LiveSource(topics=names, goal="goal_pose", restart="again")
    ctx = Context("source", folder=tmp_path)
    source.setup(ctx)
    synchronizer = source._join(LiveSourceState())
    topics = {IMAGE, ODOMETRY, TRUTH, "/scan", "/tf_static", "/initialpose", "/goal_pose", "/again"}
    assert synchronizer.header.topics.keys() == topics
    assert wire.queue._messages.keys() == topics | {"/camera/camera_info"}
    send(wire, "pose", POSE, encode(POSE, {}))
    assert [topic for topic, _ in wire.sent] == ["/pose"]


def test_a_second_node_on_a_published_topic_is_noted(wire: Wire, tmp_path: Path):
    drive = Drive(tmp_path, topics=Topics(scan=None))
    drive.feed(wire, said())
    for topic, kind in (("/cmd_vel", "geometry_msgs/msg/Twist"), ("/tf", "tf2_msgs/msg/TFMessage")):
        send(wire, topic, kind, encode(kind, {}))
        wire.there[topic] = kind
    drive.synchronizer.watch()
    assert wire.status.troubles == {"sent /cmd_vel": "another node publishes /cmd_vel too; end one of them"}


def test_scans_of_another_clock_than_the_cameras_are_noted(wire: Wire, tmp_path: Path):
    drive = Drive(tmp_path)
    drive.feed(wire, [each._replace(data=ahead(each.data, 1000)) if each.topic == "/scan" else each for each in said()])
    drive.synchronizer.watch()
    assert drive.outs
    assert wire.status.troubles.keys() == {"/scan"}
    assert "/scan: nothing of it is stamped in the second before an image" in wire.status.troubles["/scan"]


def test_the_time_of_a_run_goes_on_where_the_clock_is_set_back() -> None:
    state = LiveSourceState()
    for second in (1000, 1010, 20, 25):
        tick, _ = state.turn(second * 10**9)
    assert (tick.log, state.stamp - state.first) == (1, 15 * 10**9)
