"""The live source over a transport of the test's own; the same over real rclpy is in tests/stages/live."""

import os
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from omninav.pipeline import Context
from omninav.pipeline.graph.problems import BadInput
from omninav.pipeline.mcap.message_types import encode_message, header_stamp
from omninav.pipeline.mcap.reader import LogReader
from omninav.stages.live import intake
from omninav.stages.live import live_source as live
from omninav.stages.live.live_source import LiveSource, LiveSourceState
from omninav.stages.live.status import LiveStatus
from omninav.stages.live.transport import Arrival, Transport
from omninav.stages.recordings.recording import Topics
from omninav.stages.recordings.topics import IMAGE_TOPICS
from omninav.stages.source.log import LogSource
from omninav.stages.source.playback import PlaybackState

DRIVE = Path(__file__).parents[2] / "data/drive.mcap"
CAMERA = str(Path(__file__).parents[2] / "data/camera.yaml")
POSE = "geometry_msgs/msg/PoseWithCovarianceStamped"


class Loopback(Transport):
    """A robot in this process: what it says waits to be taken."""

    def subscribe(self, topic: str, msgtype: str, newest: bool = False) -> None:
        self.inbox.open(topic, newest)

    def publish(self, topic: str, msgtype: str, data: bytes, latched: bool = False) -> None:
        self.sent = [*getattr(self, "sent", []), (topic, msgtype, data)]

    def offered(self) -> dict[str, str]:
        return getattr(self, "offers", {})

    def close(self) -> None:
        pass


def said() -> list[Arrival]:
    """What the recorded robot said, in the order in which it was received."""
    reader = LogReader(DRIVE)
    types = reader.topics
    records = sorted(reader.scan(), key=lambda record: record.log_time)
    return [Arrival(each.topic, types[each.topic], each.log_time, bytes(each.data)) for each in records]


@pytest.fixture
def robot(monkeypatch: pytest.MonkeyPatch) -> Loopback:
    loopback = Loopback()
    loopback.place = "a test"
    monkeypatch.setattr(live, "connect", lambda transport, domain: loopback)
    monkeypatch.setattr(live, "disconnect", lambda: None)
    return loopback


class Drive:
    """A live source that is stepped; a tick is made as soon as one can be."""

    def __init__(self, folder: Path, state: LiveSourceState | None = None, **parameters: object) -> None:
        self.source = LiveSource(**{"camera": CAMERA, "diagnostics": None, **parameters})
        self.ctx = Context("source", folder=folder)
        self.state = state or LiveSourceState()
        self.source.setup(self.ctx)
        self.outs: list[LiveSource.Out] = []

    def join(self) -> None:
        """Subscribe, without a tick."""
        self.source._intake = self.source._join(self.state)

    def feed(self, robot: Loopback, arrivals: list[Arrival]) -> None:
        """One message after another, and every tick that they lead to."""
        intake = self.source._intake
        assert intake is not None
        for arrival in arrivals:
            if arrival.topic in self.source._header.topics:
                robot.inbox.put(arrival)
            taken = intake.next(0.0)
            if taken is not None:
                monkey = intake.next
                intake.next = lambda wait_s, taken=taken: taken  # type: ignore[method-assign]
                out = self.source.step(self.ctx, self.state)
                intake.next = monkey  # type: ignore[method-assign]
                assert out is not None
                self.outs.append(out)

    def end(self) -> None:
        """As Ctrl-C ends it."""
        self.source._stop.set()
        assert self.source.step(self.ctx, self.state) is None


def replayed(record: Path) -> list[LogSource.Out]:
    source, state = LogSource(log=str(record)), PlaybackState()
    ctx = Context("source")
    source.setup(ctx)
    outs = []
    while (out := source.step(ctx, state)) is not None:
        outs.append(out)
    return outs


def same(live_outs: list[LiveSource.Out], log_outs: list[LogSource.Out]) -> None:
    assert len(live_outs) == len(log_outs) > 0
    for one, other in zip(live_outs, log_outs, strict=True):
        assert vars(one.tick) == vars(other.tick)
        assert one.image.pixels.tobytes() == other.image.pixels.tobytes()
        for name in ("odometry", "motion", "truth", "restart", "goal"):
            mine, theirs = getattr(one, name), getattr(other, name)
            assert type(mine) is type(theirs), name
            assert mine is None or vars(mine) == vars(theirs), name


def test_the_record_of_a_live_drive_gives_the_same_ticks_as_the_drive(robot: Loopback, tmp_path: Path):
    drive = Drive(tmp_path)
    drive.join()
    drive.feed(robot, said())
    drive.end()
    assert len(drive.outs) > 5
    assert drive.outs[3].motion is not None
    same(drive.outs, replayed(tmp_path / "live.mcap"))


def test_a_mirror_of_which_nothing_is_known_is_recorded_with_the_ring_of_its_first_image(
    robot: Loopback, tmp_path: Path
):
    (tmp_path / "camera.yaml").write_text("{projection: donut, image: {width: 280, height: 210}}")
    for camera in ("donut", str(tmp_path / "camera.yaml")):
        drive = Drive(tmp_path, camera=camera)
        drive.join()
        drive.feed(robot, said())
        drive.end()
        assert drive.outs[0].camera.ring == pytest.approx((139.5, 104.5, 15.0, 104.0), abs=3.0)
        again = replayed(tmp_path / "live.mcap")
        same(drive.outs, again)
        assert again[0].camera.ring == drive.outs[0].camera.ring
        (tmp_path / "live.mcap").unlink()


def test_a_pose_and_a_goal_that_somebody_names_are_in_the_record_at_the_tick_that_had_them(
    robot: Loopback, tmp_path: Path
):
    messages = said()
    where = {"pose": {"pose": {"position": {"x": 1.5}, "orientation": {"w": 1.0}}, "covariance": np.full(36, 0.25)}}
    goal = {"pose": {"position": {"x": 3.0, "y": -1.0}, "orientation": {"w": 1.0}}}
    half = len(messages) // 2
    messages[half:half] = [
        Arrival("/initialpose", POSE, messages[half].received, encode_message(POSE, where, 0)),
        Arrival(
            "/goal_pose",
            "geometry_msgs/msg/PoseStamped",
            messages[half].received,
            encode_message("geometry_msgs/msg/PoseStamped", goal, 0),
        ),
    ]
    drive = Drive(tmp_path)
    drive.join()
    drive.feed(robot, messages)
    drive.end()
    asked = [out for out in drive.outs if out.restart is not None]
    assert [out.restart.at for out in asked if out.restart] == [(1.5, 0.0, 0.0, 0.5, 0.5)]
    assert [(out.goal.x, out.goal.y) for out in asked if out.goal] == [(3.0, -1.0)]
    same(drive.outs, replayed(tmp_path / "live.mcap"))


def test_a_run_that_was_killed_makes_its_ticks_again_and_goes_on(robot: Loopback, tmp_path: Path):
    messages = said()
    drive = Drive(tmp_path)
    drive.join()
    drive.feed(robot, messages[: len(messages) // 2])
    done = len(drive.outs)
    assert done > 2
    state = LiveSourceState()  # of a checkpoint before the first tick: all ticks are made again
    robot.inbox.__init__()  # type: ignore[misc]
    resumed = Drive(tmp_path, state)
    again = [resumed.source.step(resumed.ctx, state) for _ in range(done)]
    same(drive.outs, [out for out in again if out is not None])  # type: ignore[misc]
    resumed.join()
    resumed.feed(robot, messages[len(messages) // 2 :])
    resumed.end()
    assert resumed.outs[0].motion is not None
    assert not resumed.outs[0].tick.first_of_log
    same([*drive.outs, *resumed.outs], replayed(tmp_path / "live.mcap"))
    assert sorted(os.listdir(tmp_path)) == ["live.mcap"]


@pytest.mark.parametrize(
    ("spoilt", "kind"),
    [
        (lambda arrival: arrival._replace(data=arrival.data[:40]), "bad_message"),
        (lambda arrival: arrival._replace(data=arrival.data[:7]), "bad_message"),
        (lambda arrival: arrival._replace(data=arrival.data[:200] + b"\0" * (len(arrival.data) - 200)), "undecodable"),
    ],
    ids=["cut", "shorter than a header", "zeros"],
)
def test_a_damaged_image_is_counted_and_the_next_one_is_used(
    robot: Loopback, tmp_path: Path, spoilt: Callable[[Arrival], Arrival], kind: str
):
    messages = said()
    images = [number for number, each in enumerate(messages) if each.topic.startswith("/camera/image")]
    messages[images[4]] = spoilt(messages[images[4]])
    drive = Drive(tmp_path)
    drive.join()
    drive.feed(robot, messages)
    drive.end()
    assert any(name.startswith(kind) for name in drive.ctx.counts), drive.ctx.counts
    assert len(drive.outs) > 5
    same(drive.outs, replayed(tmp_path / "live.mcap"))


def test_a_scan_that_none_can_be_is_counted_and_the_drive_goes_on(robot: Loopback, tmp_path: Path):
    messages, kind = said(), "sensor_msgs/msg/LaserScan"
    number = [number for number, each in enumerate(messages) if each.msgtype == kind][4]
    still = {"angle_increment": 0.0, "range_max": 4.0, "ranges": np.ones(60, np.float32)}
    stamp = messages[number].received
    messages[number] = messages[number]._replace(data=encode_message(kind, still, stamp))
    drive = Drive(tmp_path)
    drive.join()
    drive.feed(robot, messages)
    drive.end()
    assert any(name.startswith("bad_message") for name in drive.ctx.counts), drive.ctx.counts
    assert len(drive.outs) > 5
    same(drive.outs, replayed(tmp_path / "live.mcap"))


def test_images_of_another_size_are_refused_at_the_start_and_counted_later(robot: Loopback, tmp_path: Path):
    kind = "sensor_msgs/msg/Image"
    small = {"height": 2, "width": 2, "encoding": "mono8", "step": 2, "data": np.array([0, 90, 120, 250], np.uint8)}

    def image(stamp: int) -> Arrival:
        return Arrival("/camera/image", kind, stamp, encode_message(kind, small, stamp))

    messages = said()
    last = max(LogReader(DRIVE).messages({"/odom"}), key=lambda message: message.stamp).stamp
    early = Drive(tmp_path)
    early.join()
    with pytest.raises(BadInput, match=r"/camera/image: its images are 2 x 2, its camera .*; give camera="):
        early.feed(robot, [*[each for each in messages if each.topic == "/odom"], image(last)])
    robot.inbox.__init__()  # type: ignore[misc]
    late = Drive(tmp_path)
    late.join()
    late.feed(robot, [*messages, image(last)])
    late.end()
    assert late.ctx.counts["wrong_size"] == 1


def test_while_a_robot_says_nothing_what_is_missing_is_noted(robot: Loopback, tmp_path: Path):
    drive = Drive(tmp_path)
    drive.join()
    assert drive.source._intake is not None
    drive.source._intake.watch()
    image, odometry = "sensor_msgs/msg/CompressedImage", "nav_msgs/msg/Odometry"
    assert robot.status.troubles == {
        "/odom": f"nothing on /odom ({odometry}) for 0 s, nobody publishes it; "
        "type speed=0.5 (m/s, a robot without odometry)",
        "/camera/image/compressed": f"nothing on /camera/image/compressed ({image}) for 0 s, nobody publishes it",
        "robot": "no publisher is seen (a test): is the robot on, and in the same domain and reach?",
    }
    drive.feed(robot, said())
    drive.source._intake.watch()
    assert not robot.status.troubles


def test_what_is_missing_is_looked_for_under_other_names_and_since_when_is_said(
    robot: Loopback, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    now = [1000.0]
    monkeypatch.setattr(intake, "time", SimpleNamespace(monotonic=lambda: now[0]))
    drive = Drive(tmp_path)
    drive.join()
    robot.offers = {
        "/wheels": "nav_msgs/msg/Odometry",
        "/omni": "sensor_msgs/msg/Image",
        "/camera/image": "std_msgs/msg/String",
    }
    now[0] += 12.0
    drive.source._intake.watch()
    assert robot.status.troubles == {
        "/odom": "nothing on /odom (nav_msgs/msg/Odometry) for 12 s, nobody publishes it; "
        "type topics.odometry=/wheels, or speed=0.5 (m/s, a robot without odometry)",
        "/camera/image": "/camera/image carries std_msgs/msg/String, not sensor_msgs/msg/Image; "
        "type topics.image=/omni",
    }


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"topics": Topics(image="/odom")}, "/odom: it cannot be both image and odometry"),
        ({"topics": Topics(truth="/odom")}, "/odom: it cannot be both odometry and truth"),
        ({"goal": "/initialpose"}, "/initialpose: it cannot be both initial_pose and goal"),
    ],
)
def test_a_topic_for_two_things_is_refused_before_anything_runs(robot: Loopback, given: dict[str, object], said: str):
    with pytest.raises(BadInput, match=f"{said}; give one of them its own topic"):
        LiveSource(camera=CAMERA, **given).check(Context("source"))


def test_images_that_odometry_never_reaches_are_a_trouble(
    robot: Loopback, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    now = [1000.0]
    monkeypatch.setattr(intake, "time", SimpleNamespace(monotonic=lambda: now[0]))
    drive = Drive(tmp_path)
    drive.join()
    images = [each._replace(data=ahead(each.data)) for each in said() if each.topic == "/camera/image/compressed"]
    odometry = [each for each in said() if each.topic == "/odom"]
    for late in (False, True):  # both go on coming
        now[0] += 3.0 * late
        for arrival in (*odometry[late::2], *images[late::2]):
            robot.inbox.put(arrival)
        assert drive.source._intake.next(0.0) is None
    drive.source._intake.watch()
    assert "no image is used: outside_odometry" in robot.status.troubles["ticks"]
    assert "odometry says up to" in robot.status.troubles["ticks"]


def ahead(data: bytes) -> bytes:
    """A message whose stamp is of a thousand seconds later."""
    seconds = int.from_bytes(data[4:8], "little") + 1000
    return data[:4] + seconds.to_bytes(4, "little") + data[8:]


def test_an_image_waits_for_truth_half_as_long_as_for_odometry(
    robot: Loopback, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    now = [1000.0]
    monkeypatch.setattr(intake, "time", SimpleNamespace(monotonic=lambda: now[0]))
    drive = Drive(tmp_path)
    drive.join()
    messages = said()
    image = next(n for n, each in enumerate(messages) if each.topic == "/camera/image/compressed" and n > 100)
    stamp = header_stamp(messages[image].data)
    for arrival in messages[: image + 100]:
        truth = arrival.topic == "/ground_truth/pose"
        if arrival.topic == "/odom" or (truth and header_stamp(arrival.data) < stamp):
            robot.inbox.put(arrival)
    robot.inbox.put(messages[image])
    assert drive.source._intake.next(0.0) is None  # its truth may still come
    now[0] += 0.45
    assert drive.source._intake.next(0.0) is None
    now[0] += 0.1
    taken = drive.source._intake.next(0.0)
    assert taken is not None
    assert (taken.stamp, bool(np.isnan(taken.frame.truth).all())) == (stamp, True)


def test_a_run_without_a_tick_is_refused_with_what_was_missing(robot: Loopback, tmp_path: Path):
    drive = Drive(tmp_path)
    drive.source._stop.set()
    with pytest.raises(
        BadInput,
        match=r"no image became a tick: no publisher .*; nothing on /camera/image/compressed .*; nothing on /odom",
    ):
        drive.source.step(drive.ctx, drive.state)


def test_latency_is_measured_from_the_arrival_and_a_clock_that_is_off_shows_as_age():
    status = LiveStatus()
    status.taken(5, time.time_ns() - 20_000_000)
    status.published(5)  # its stamp is of 1970
    assert status.latencies_ms is not None
    assert 20.0 <= status.latencies_ms[0] < 2000.0
    assert status.age_ms is not None
    assert status.age_ms > 1e12


def test_requests_that_are_turned_off_are_not_heard(robot: Loopback, tmp_path: Path):
    drive = Drive(tmp_path, initial_pose=None, goal=None, restart=None)
    drive.join()
    assert set(robot.inbox._arrivals) == {*IMAGE_TOPICS, "/odom", "/ground_truth/pose", "/scan"}
