from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from omninav.pipeline import BadInput, Context, Tick
from omninav.stages.camera.cylindrical import Cylindrical
from omninav.stages.live import publish_truth, robot_driver
from omninav.stages.live.robot_driver import CameraStop, ClockJump, RobotDriver, RobotDriverState
from omninav.stages.live.transport import RawMessage, TransportError
from omninav.stages.recordings.camera_yaml import read_camera
from omninav.stages.values.command import Command
from omninav.stages.values.episode_statistics import EpisodeStatistics
from omninav.stages.values.image import Image
from omninav.stages.values.pose import Motion, Pose
from omninav.stages.values.scan import Scan

from .conftest import OtherEnd, decode, encode, until

TWIST, STAMPED = "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"
CAMERA = Cylindrical(80, 20, 40.0, height=0.5)
IMAGE = Image(np.zeros((20, 80, 3), np.uint8))
SCAN = Scan(np.array([1.0, 2.0, np.inf]), -1.0, 1.0, 0.0, 5.0)


class Drive:
    """A driver that is given ticks five times a second, and goes 0.1 m ahead in each."""

    def __init__(self, camera=CAMERA, **parameters) -> None:
        self.camera = camera
        self.stage = RobotDriver(**{"real_time": False, **parameters})
        self.state, self.ctx, self.ticks = RobotDriverState(), Context("driver"), 0
        self.stage.setup(self.ctx)

    def tick(self) -> RobotDriver.Out:
        number, self.ticks = self.ticks, self.ticks + 1
        tick = Tick(number, 10**18 + number * 200_000_000, frame=number, first_of_log=number == 0)
        ahead = Pose(0.1 * number, 0.0, 0.0)
        motion = Motion(0.1, 0.0, 0.0) if number else None
        return self.stage.step(self.ctx, self.state, tick, self.camera, ahead, IMAGE, motion, SCAN)


def stamp_of(message):
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


@pytest.mark.parametrize("msgtype", [TWIST, STAMPED])
def test_a_command_of_either_type_holds_for_half_a_second(wire, msgtype):
    drive = Drive()
    assert drive.tick().command is None
    wire.there["/cmd_vel"] = msgtype
    drive.tick()  # it is found, and subscribed to
    twist = {"linear": {"x": 0.3}, "angular": {"z": -0.2}}
    data = encode(msgtype, twist if msgtype == TWIST else {"twist": twist})
    wire.queue.put(RawMessage("/cmd_vel", msgtype, 0, data))
    commands = [drive.tick().command for _ in range(4)]
    assert [command and (command.speed, command.turning) for command in commands] == [(0.3, -0.2)] * 3 + [None]


def test_a_command_that_is_no_number_is_counted_and_not_driven(wire):
    drive = Drive()
    wire.there["/cmd_vel"] = TWIST
    drive.tick()
    wire.queue.put(RawMessage("/cmd_vel", TWIST, 0, encode(TWIST, {"linear": {"x": float("nan")}})))
    wire.queue.put(RawMessage("/cmd_vel", TWIST, 0, b"\0\1\0\0cut"))
    assert drive.tick().command is None
    assert drive.ctx.counts == {"impossible_command": 1, "bad_message": 1}


def test_odometry_comes_at_its_own_rate_and_ends_at_the_image(wire):
    drive = Drive()
    drive.tick()
    drive.tick()
    odometry = wire.on("/odom")
    np.testing.assert_allclose([m.pose.pose.position.x for m in odometry], [0.0, 0.025, 0.05, 0.075, 0.1])
    assert np.diff([stamp_of(message) for message in odometry]).tolist() == [50_000_000] * 4
    assert stamp_of(odometry[-1]) == stamp_of(wire.on("/camera/image/compressed")[-1]) == stamp_of(wire.on("/scan")[-1])
    assert odometry[-1].twist.twist.linear.x == pytest.approx(0.5)
    assert len(wire.on("/tf")) == len(odometry)
    assert [t.child_frame_id for m in wire.on("/tf_static") for t in m.transforms] == ["omni_camera"]
    clock = wire.on("/clock")[-1].clock
    assert clock.sec * 10**9 + clock.nanosec == stamp_of(odometry[-1])


def test_the_camera_fails_and_the_clock_leaps_when_they_are_told_to(wire):
    drive = Drive(camera_stops=(CameraStop(0.4, 0.4),), clock_jumps=(ClockJump(1.0, -0.5),))
    stamps = [drive.tick().tick.stamp for _ in range(7)]
    assert np.diff(stamps).tolist() == [200_000_000] * 4 + [-300_000_000, 200_000_000]
    shown = [stamp_of(message) for message in wire.on("/camera/image/compressed")]
    assert shown == [stamp for number, stamp in enumerate(stamps) if number not in (2, 3)]


def test_images_are_stamped_as_late_as_the_camera_is_described(wire):
    drive = Drive(camera=replace(CAMERA, delay=0.25))
    taken = [drive.tick().tick.stamp for _ in range(3)]
    for topic in ("/camera/image/compressed", "/camera/camera_info"):
        assert [stamp_of(message) - 250_000_000 for message in wire.on(topic)] == taken


def test_the_camera_is_described_in_a_file(wire, tmp_path):
    Drive(camera_file=str(tmp_path / "robot.camera.yaml")).tick()
    assert read_camera(tmp_path / "robot.camera.yaml").height == CAMERA.height
    Drive(camera_file=str(tmp_path / "robot.camera.yaml")).tick()
    (tmp_path / "mine.yaml").write_text("projection: donut")
    with pytest.raises(BadInput, match="it is there, and not this world's camera"):
        Drive(camera_file=str(tmp_path / "mine.yaml")).tick()
    assert (tmp_path / "mine.yaml").read_text() == "projection: donut"


def test_in_real_time_a_tick_takes_its_time(wire, monkeypatch):
    now = [100.0]

    def take(timeout_s):
        now[0] += timeout_s

    monkeypatch.setattr(wire, "take", take)
    monkeypatch.setattr(robot_driver, "time", SimpleNamespace(monotonic=lambda: now[0], time_ns=lambda: 10**18))
    drive, moments = Drive(real_time=True), []
    for _ in range(5):
        drive.tick()
        moments.append(now[0])
    assert np.diff(moments[1:]) == pytest.approx([0.2] * 3)


def test_a_topic_whose_type_is_not_installed_is_left_out(wire, monkeypatch):
    def publish(topic, msgtype, data, latched=False):
        if "tf2" in msgtype:
            raise TransportError(f"{topic}: not installed")
        wire.sent.append((topic, data))

    monkeypatch.setattr(wire, "publish", publish)
    Drive().tick()
    assert {"/odom", "/scan", "/clock"} <= {topic for topic, _ in wire.sent}
    assert sorted(wire.status.left_out) == ["/tf", "/tf_static"]


def test_truth_and_collisions_have_the_stamps_of_the_driver(wire):
    stage = publish_truth.PublishTruth()
    stage.setup(Context("truth"))
    stage.step(Context("truth"), Tick(0, 7_000_000_001), Pose(1.0, 2.0, 0.5), EpisodeStatistics(3, 10.0))
    assert stamp_of(wire.on("/ground_truth/pose")[0]) == 7_000_000_001
    assert wire.on("/collisions")[0].data == 3


def test_the_simulator_is_a_robot_without_ros(domain, omninav, tmp_path):
    words = ("live=dds", "real_time=false", "camera=robot.camera.yaml", "nodes.source.seconds=0.6")
    omninav("simulate", *words, check=True)
    assert read_camera(tmp_path / "robot.camera.yaml").projection == "hyperbolic"


def test_a_node_of_ros_2_hears_the_robot_and_drives_it(other_end: OtherEnd):
    drive = Drive(transport="dds", real_time=True)
    drive.tick()
    for topic, msgtype in [("/odom", "nav_msgs/msg/Odometry"), ("/scan", "sensor_msgs/msg/LaserScan")]:
        other_end.order("subscribe", topic, type=msgtype)
    other_end.order("advertise", "/cmd_vel", type=STAMPED)
    commands: list[Command | None] = []

    def driven() -> bool:
        other_end.publish("/cmd_vel", encode(STAMPED, {"twist": {"linear": {"x": 0.25}}}))
        commands.append(drive.tick().command)
        return commands[-1] is not None

    until(driven)
    assert commands[-1].speed == 0.25
    odometry = decode("nav_msgs/msg/Odometry", other_end.hear("/odom"))
    assert (odometry.header.frame_id, odometry.child_frame_id) == ("odom", "base_link")
    np.testing.assert_allclose(decode("sensor_msgs/msg/LaserScan", other_end.hear("/scan")).ranges, SCAN.ranges)
