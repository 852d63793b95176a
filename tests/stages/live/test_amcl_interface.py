"""What docs/live.md says of nav2's AMCL interface, asked by a node of real rclpy."""

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from .conftest import ROOT, ROS2_PYTHON, OtherEnd, decode, encode, until

POSE = "geometry_msgs/msg/PoseWithCovarianceStamped"
PAGE = ROOT / "docs/live.md"


@pytest.fixture
def node(other_end: OtherEnd) -> Iterator["subprocess.Popen[str]"]:
    """omninav with transport=rclpy: in rclpy's Python, with our libraries."""
    script = Path(__file__).parent / "amcl_node.py"
    libraries = f"{ROOT}{os.pathsep}{Path(np.__file__).parents[1]}"
    process = subprocess.Popen(
        [str(ROS2_PYTHON), str(script), "600"],
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONPATH": libraries},
    )
    assert process.stdout is not None
    if process.stdout.readline().strip() != "ready":
        pytest.skip(f"{ROS2_PYTHON} and {sys.executable} are not of one Python: their libraries do not go together")
    yield process
    process.kill()
    process.wait(timeout=10)


def line(node: "subprocess.Popen[str]") -> str:
    assert node.stdout is not None
    return node.stdout.readline().strip()


def test_pose_initial_pose_and_global_localisation_are_answered(other_end: OtherEnd, node: "subprocess.Popen[str]"):
    other_end.order("subscribe", "/amcl_pose", type=POSE, durability="TRANSIENT_LOCAL")
    pose = decode(POSE, other_end.hear("/amcl_pose")).pose.pose
    assert (pose.position.x, pose.position.y) == (1.0, 2.0)
    assert 2 * np.arctan2(pose.orientation.z, pose.orientation.w) == pytest.approx(0.5)

    other_end.order("call", "/reinitialize_global_localization", type="std_srvs/srv/Empty")
    assert "Empty_Response" in other_end.wait("answer")
    assert line(node) == "restart None"

    other_end.order("advertise", "/initialpose", type=POSE)
    until(lambda: other_end.order("matched", "/initialpose") or other_end.wait("matched") == 1)
    where = {"pose": {"pose": {"position": {"x": 3.0}, "orientation": {"w": 1.0}}, "covariance": np.full(36, 0.25)}}
    other_end.publish("/initialpose", encode(POSE, where, 1))
    assert line(node) == "restart (3.0, 0.0, 0.0, 0.5, 0.5)"


@pytest.mark.parametrize("name", ["/amcl_pose", "/particle_cloud", "/initialpose", "/map", "/scan", "/tf"])
def test_the_page_says_of_each_topic_whether_it_is_answered(name: str):
    rows = [
        row for row in PAGE.read_text().partition("## In AMCL's place")[2].splitlines() if row.startswith(f"| `{name}`")
    ]
    assert len(rows) == 1
    assert rows[0].split("|")[3].strip().startswith(("yes", "no"))
