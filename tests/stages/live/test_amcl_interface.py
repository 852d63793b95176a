"""What docs/live.md says of nav2's AMCL interface, asked by a node of real rclpy."""

import os
import queue
import subprocess
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from omninav.stages.live.amcl_services import serve_amcl
from omninav.stages.live.transport import TransportError

from .conftest import ROOT, ROS2_PYTHON, WAIT_S, OtherEnd, Wire, decode, encode, ours_for_rclpy, until

POSE = "geometry_msgs/msg/PoseWithCovarianceStamped"
PAGE = ROOT / "docs/live.md"


@pytest.fixture
def node(other_end: OtherEnd) -> Iterator["queue.Queue[str]"]:
    """omninav with transport=rclpy, in rclpy's Python with our libraries: the lines that it says."""
    script = Path(__file__).parent / "amcl_node.py"
    process = subprocess.Popen(
        [str(ROS2_PYTHON), str(script)],
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONPATH": ours_for_rclpy()},
    )
    assert process.stdout is not None
    assert process.stdout.readline().strip() == "ready"
    said: queue.Queue[str] = queue.Queue()
    output = process.stdout
    threading.Thread(target=lambda: [said.put(line.strip()) for line in output], daemon=True).start()
    yield said
    process.kill()
    process.wait(timeout=WAIT_S)


def test_amcls_topics_and_services_are_answered(other_end: OtherEnd, node: "queue.Queue[str]"):
    other_end.order("subscribe", "/amcl_pose", type=POSE, durability="TRANSIENT_LOCAL")
    pose = decode(POSE, other_end.hear("/amcl_pose")).pose.pose
    assert (pose.position.x, pose.position.y) == (1.0, 2.0)
    assert 2 * np.arctan2(pose.orientation.z, pose.orientation.w) == pytest.approx(0.5)

    other_end.order("call", "/reinitialize_global_localization", type="std_srvs/srv/Empty")
    assert "Empty_Response" in other_end.wait("answer")
    assert node.get(timeout=WAIT_S) == "restart None"

    services = [
        ("/request_nomotion_update", "std_srvs/srv/Empty", {}, "Empty_Response()"),
        ("/amcl/get_state", "lifecycle_msgs/srv/GetState", {}, "label='active'"),
        ("/amcl/change_state", "lifecycle_msgs/srv/ChangeState", {"transition": {"id": 4}}, "success=True"),
        ("/amcl/get_state", "lifecycle_msgs/srv/GetState", {}, "label='inactive'"),
        ("/amcl/change_state", "lifecycle_msgs/srv/ChangeState", {"transition": {"id": 77}}, "success=False"),
        ("/amcl/get_state", "lifecycle_msgs/srv/GetState", {}, "label='inactive'"),
    ]
    for name, kind, request, answer in services:
        other_end.order("call", name, type=kind, request=request)
        assert answer in other_end.wait("answer"), name

    other_end.order("advertise", "/initialpose", type=POSE)
    where = {"pose": {"pose": {"position": {"x": 3.0}, "orientation": {"w": 1.0}}, "covariance": np.full(36, 0.25)}}

    def heard() -> bool:
        other_end.publish("/initialpose", encode(POSE, where, 1))  # before both ends have matched it is lost
        with suppress(queue.Empty):
            return node.get(timeout=0.5) == "restart (3.0, 0.0, 0.0, 0.5, 0.5)"
        return False

    until(heard)


class Services(Wire):
    """A transport that has services, and no other end."""

    def __init__(self) -> None:
        super().__init__()
        self.answers: dict[str, Callable[[bytes], bytes]] = {}

    def serve(self, service, srvtype, answer):
        if srvtype.startswith("lifecycle_msgs"):
            raise TransportError(f"transport=rclpy: {service}: the type {srvtype} is not installed")
        self.answers[service] = answer
        return True


def test_a_pose_that_is_set_by_service_comes_as_one_by_topic_does():
    transport = Services()
    transport.queue.open("/initialpose", newest=False)
    serve_amcl(transport, "amcl", "/initialpose")
    asked = encode(POSE, {"pose": {"pose": {"position": {"x": 3.0}}}, "header": {"frame_id": "map"}}, 7)
    transport.answers["/set_initial_pose"](asked)  # a request is its one field
    message = transport.take()
    assert message is not None
    assert (message.topic, message.msgtype, message.data) == ("/initialpose", POSE, asked)


def test_a_service_whose_type_is_not_installed_is_left_out_and_said_once():
    transport = Services()
    serve_amcl(transport, "amcl", None)
    assert sorted(transport.answers) == ["/request_nomotion_update"]
    assert sorted(transport.status.left_out) == ["/amcl/change_state", "/amcl/get_state"]
    assert [why.partition(" is not ")[0][-12:] for why in transport.status.news()] == ["/ChangeState", "srv/GetState"]
    assert transport.status.news() == []


INTERFACE = ["/amcl_pose", "/particle_cloud", "/initialpose", "/map", "/scan", "/tf"]
INTERFACE += ["/reinitialize_global_localization", "/request_nomotion_update", "/set_initial_pose"]
INTERFACE += ["/amcl/get_state", "/amcl/change_state"]


@pytest.mark.parametrize("name", INTERFACE)
def test_the_page_says_of_each_topic_and_service_whether_it_is_answered(name: str):
    rows = [
        row for row in PAGE.read_text().partition("## In AMCL's place")[2].splitlines() if row.startswith(f"| `{name}`")
    ]
    assert len(rows) == 1
    assert rows[0].split("|")[3].strip().startswith(("yes", "no"))
