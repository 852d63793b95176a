"""The zenoh transport between two processes and a router, and the keys by which nodes with rmw_zenoh find it."""

import subprocess
import sys
from pathlib import Path

import pytest

from omninav.pipeline import Context, Tick
from omninav.stages.live.publish_truth import PublishTruth
from omninav.stages.live.transport import TransportError, connect, disconnect
from omninav.stages.values.episode_statistics import EpisodeStatistics
from omninav.stages.values.pose import Pose

from .conftest import WAIT_S, decode, encode, until

zenoh = pytest.importorskip("zenoh")
ODOMETRY, TWIST, POSE = "nav_msgs/msg/Odometry", "geometry_msgs/msg/Twist", "geometry_msgs/msg/PoseStamped"
STRING = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
"""std_msgs/String, in the examples of rmw_zenoh's own design document."""


def test_messages_pass_both_ways_between_two_processes(router: object):
    transport = connect("zenoh", 3)
    transport.subscribe("/odom", ODOMETRY)
    pose = encode(POSE, {}, 1)
    transport.publish("/pose", POSE, pose, latched=True)
    script = str(Path(__file__).parent / "zenoh_robot.py")
    robot = subprocess.Popen([sys.executable, script], stdout=subprocess.PIPE, text=True)
    try:
        got = transport.take(WAIT_S)
        assert got is not None
        assert (got.topic, decode(ODOMETRY, got.data).child_frame_id) == ("/odom", "base_link")
        until(lambda: transport.offered().get("/odom") == ODOMETRY)
        twist = encode(TWIST, {"linear": {"x": 0.25}})
        until(lambda: transport.publish("/cmd_vel", TWIST, twist) or robot.poll() is not None)
        assert robot.stdout is not None
        assert robot.stdout.read().split() == ["/cmd_vel", TWIST, twist.hex(), POSE, pose.hex()]
    finally:
        robot.kill()
        robot.wait()


def test_keys_tokens_and_attachments_are_rmw_zenohs(router: zenoh.Session):
    heard: list[zenoh.Sample] = []
    listener = router.declare_subscriber(f"2/chatter/std_msgs::msg::dds_::String_/{STRING}", heard.append)
    transport = connect("zenoh", 2)
    until(lambda: transport.publish("/chatter", "std_msgs/msg/String", encode("std_msgs/msg/String", {})) or heard)
    attachment = heard[0].attachment.to_bytes()
    assert (len(attachment), attachment[16]) == (33, 16)  # two int64, and 16 bytes after their number
    replies = router.liveliness().get("@ros2_lv/2/**", timeout=5.0)
    tokens = sorted(str(reply.ok.key_expr).split("/", 3)[3] for reply in replies)
    assert tokens == [
        "0/0/NN/%/%/omninav",
        f"0/2/MP/%/%/omninav/%chatter/std_msgs::msg::dds_::String_/{STRING}/::,16:,:,:,,",
    ]
    listener.undeclare()


def test_the_simulated_robot_speaks_it(router: zenoh.Session):
    heard: list[zenoh.Sample] = []
    listener = router.declare_subscriber("5/ground_truth/pose/**", heard.append)
    ctx, truth = Context("truth"), PublishTruth(transport="zenoh", domain=5)
    truth.setup(ctx)
    until(lambda: truth.step(ctx, Tick(0, 7), Pose(1.0, 2.0, 0.5), EpisodeStatistics(0, 0.0)) or heard)
    assert decode(POSE, heard[0].payload.to_bytes()).pose.position.y == 2.0
    listener.undeclare()


def test_a_configuration_that_is_none_is_refused_in_one_line(monkeypatch: pytest.MonkeyPatch):
    for value in ("connect/endpoints=nonsense", "nonsense=1"):
        monkeypatch.setenv("ZENOH_CONFIG_OVERRIDE", value)
        with pytest.raises(TransportError, match="transport=zenoh: a session cannot be opened"):
            connect("zenoh", 4)
    monkeypatch.setenv("ZENOH_CONFIG_OVERRIDE", "")
    monkeypatch.setenv("ZENOH_SESSION_CONFIG_URI", "/nowhere.json5")
    with pytest.raises(TransportError, match="transport=zenoh: a session cannot be opened"):
        connect("zenoh", 4)


def test_a_router_that_does_not_answer_is_named_and_one_that_does_is_not(
    router: zenoh.Session, monkeypatch: pytest.MonkeyPatch
):
    assert "router" not in connect("zenoh", 6).unseen()
    disconnect()
    monkeypatch.setenv("ZENOH_CONFIG_OVERRIDE", 'connect/endpoints=["tcp/127.0.0.1:9"]')
    assert "no router answers; type `ros2 run rmw_zenoh_cpp rmw_zenohd`" in connect("zenoh", 6).unseen()
