import subprocess
import sys

import pytest

from omninav.stages.live.dds_transport import _settings
from omninav.stages.live.transport import MessageQueue, RawMessage, TransportError, connect

from .conftest import WAIT_S, OtherEnd, decode, encode, until

ODOMETRY, POSE = "nav_msgs/msg/Odometry", "geometry_msgs/msg/PoseWithCovarianceStamped"


def message(topic: str, received: int) -> RawMessage:
    return RawMessage(topic, ODOMETRY, received, b"")


def test_of_a_topic_whose_newest_is_wanted_older_ones_are_overtaken_and_counted():
    queue = MessageQueue()
    queue.open("/image", newest=True)
    queue.open("/odom", newest=False)
    for received in range(4):
        queue.put(message("/image", received))
        queue.put(message("/odom", received))
    taken = [queue.take(0.0) for _ in range(6)]
    assert [(one.topic, one.received) for one in taken if one] == [
        ("/odom", 0),
        ("/odom", 1),
        ("/odom", 2),
        ("/image", 3),
        ("/odom", 3),
    ]
    assert queue.overtaken == {"/image": 3}


def test_an_empty_inbox_gives_none_in_time():
    queue = MessageQueue()
    queue.open("/odom", newest=False)
    assert queue.take(0.01) is None


@pytest.mark.parametrize("value", ["robots", "233", "-1"])
def test_a_domain_that_is_none_is_refused(monkeypatch: pytest.MonkeyPatch, value: str):
    monkeypatch.setenv("ROS_DOMAIN_ID", value)
    with pytest.raises(TransportError, match=r"ROS_DOMAIN_ID=.* expected a whole number"):
        connect("dds")


@pytest.fixture(params=["SUBNET", "LOCALHOST"])
def reach(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """How far both ends look for each other."""
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", request.param)


def test_messages_pass_both_ways_between_dds_and_rclpy(reach: None, other_end: OtherEnd):
    transport = connect("dds")
    transport.subscribe("/odom", ODOMETRY)
    other_end.order("advertise", "/odom", type=ODOMETRY)
    until(lambda: transport.offered().get("/odom") == ODOMETRY)
    until(lambda: other_end.order("matched", "/odom") or other_end.wait("matched") == 1)
    sent = encode(ODOMETRY, {"pose": {"pose": {"position": {"x": 1.25}}}, "child_frame_id": "base_link"}, 7_000_000_001)
    other_end.publish("/odom", sent)
    got = transport.take(10.0)
    assert got is not None
    assert (got.topic, got.msgtype) == ("/odom", ODOMETRY)
    assert str(decode(ODOMETRY, got.data)) == str(decode(ODOMETRY, sent))

    pose = encode(POSE, {"pose": {"pose": {"position": {"y": -2.5}}}, "header": {"frame_id": "map"}}, 9)
    transport.publish("/amcl_pose", POSE, pose, latched=True)
    other_end.order("subscribe", "/amcl_pose", type=POSE, durability="TRANSIENT_LOCAL")  # it comes too late
    assert str(decode(POSE, other_end.hear("/amcl_pose"))) == str(decode(POSE, pose))


def test_what_was_said_before_is_heard_where_it_is_asked_for(other_end: OtherEnd):
    transport = connect("dds")
    said = encode(POSE, {"pose": {"pose": {"position": {"x": 3.0}}}}, 5)
    for topic in ("/lasting", "/passing"):
        other_end.order("advertise", topic, type=POSE, durability="TRANSIENT_LOCAL")
        other_end.publish(topic, said)
    until(lambda: {"/lasting", "/passing"} <= transport.offered().keys())
    transport.subscribe("/passing", POSE)
    transport.subscribe("/lasting", POSE, latched=True)
    got = transport.take(10.0)
    assert got is not None
    assert (got.topic, str(decode(POSE, got.data))) == ("/lasting", str(decode(POSE, said)))
    assert transport.take(0.2) is None


def test_a_qos_that_does_not_fit_is_named(other_end: OtherEnd):
    transport = connect("dds")
    transport.publish("/pose", POSE, encode(POSE, {}, 1))
    other_end.order("subscribe", "/pose", type=POSE, durability="TRANSIENT_LOCAL")  # ours is volatile
    until(lambda: transport.mismatched() == {"/pose": "durability"})


SEE = """
import sys, time
from omninav.stages.live.transport import connect
transport, until = connect("dds"), time.monotonic() + float(sys.argv[1])
while "/hello" not in transport.offered() and time.monotonic() < until:
    time.sleep(0.1)
print(sorted(transport.offered()), flush=True)
"""


@pytest.mark.parametrize(("reach", "seen"), [("LOCALHOST", "['/hello']"), ("OFF", "[]")])
def test_discovery_reaches_as_far_as_ros_says(domain: int, monkeypatch: pytest.MonkeyPatch, reach: str, seen: str):
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", reach)
    assert "<AllowMulticast>false" in _settings()  # nothing is sent to the network to be found
    connect("dds").publish("/hello", "std_msgs/msg/String", encode("std_msgs/msg/String", {"data": "x"}))
    words = [sys.executable, "-c", SEE, "30" if reach == "LOCALHOST" else "3"]
    assert subprocess.run(words, capture_output=True, text=True, timeout=WAIT_S, check=True).stdout.strip() == seen


SPEAK = """
import sys
from omninav.stages.live.transport import connect
connect("dds").publish("/hello", "std_msgs/msg/String", bytes(12))
sys.stdin.read()
"""


def test_a_publisher_that_has_left_offers_nothing(domain: int):
    transport = connect("dds")
    with subprocess.Popen([sys.executable, "-c", SPEAK], stdin=subprocess.PIPE) as other:
        until(lambda: "/hello" in transport.offered())
        other.communicate()
    until(lambda: "/hello" not in transport.offered())


def test_without_limits_discovery_is_cyclones_own(monkeypatch: pytest.MonkeyPatch):
    for name in ("ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_STATIC_PEERS"):
        monkeypatch.delenv(name, raising=False)
    assert "Multicast" not in _settings()
    assert "<Discovery>" not in _settings()
