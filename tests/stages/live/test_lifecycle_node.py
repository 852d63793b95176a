"""The lifecycle node of `ros2/omninav_ros`, driven by another node of real rclpy through its services."""

import os
import queue
import shutil
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from background_runs import run_here
from conftest import DRIVE, TOUR

from omninav import open_run
from omninav.pipeline.mcap.reader import LogReader

from .conftest import ROOT, ROS2_PYTHON, WAIT_S, OtherEnd, ours_for_rclpy, until

PACKAGE = ROOT / "ros2/omninav_ros"
CONFIGURE, CLEAN_UP, ACTIVATE, DEACTIVATE = 1, 2, 3, 4
TOPICS = {"/odom": "/renamed/odometry", "/camera/image/compressed": "/renamed/image/compressed"}

Start = Callable[..., subprocess.Popen[bytes]]


@pytest.fixture
def start(other_end: OtherEnd, tmp_path: Path) -> Iterator[Start]:
    """Starts the node in an empty folder, all its topics renamed; what it logs is in `node.log` there."""
    environment = os.environ | {"PYTHONPATH": f"{PACKAGE}{os.pathsep}{ours_for_rclpy()}"}
    names = "camera_info odometry scan initial_pose goal restart pose tf command diagnostics"
    settings = {f"topics.{name}": f"/renamed/{name}" for name in names.split()}
    settings |= {"topics.image": TOPICS["/camera/image/compressed"], "variant": "omniview_mcl", "map": "place.omap"}
    settings |= {"camera": str(ROOT / "tests/data/camera.yaml"), "overrides": "[plots=none]"}
    words = [word for name, value in settings.items() for word in ("-p", f"{name}:={value}")]
    nodes = []

    def start(*more: str) -> subprocess.Popen[bytes]:
        with open(tmp_path / "node.log", "ab") as log:
            command = [str(ROS2_PYTHON), "-m", "omninav_ros.node", "--ros-args", *words, *more]
            nodes.append(subprocess.Popen(command, cwd=tmp_path, env=environment, stdout=log, stderr=log))
        return nodes[-1]

    yield start
    for node in nodes:
        node.kill()
        node.wait(timeout=WAIT_S)


def call(other_end: OtherEnd, service: str, srvtype: str, request: dict | None = None, within: float = WAIT_S) -> str:
    other_end.order("call", f"/omninav/{service}", type=srvtype, request=request or {})
    return str(other_end.wait("answer", within))


def change(other_end: OtherEnd, transition: int) -> bool:
    answer = call(other_end, "change_state", "lifecycle_msgs/srv/ChangeState", {"transition": {"id": transition}})
    return "success=True" in answer


def localised(other_end: OtherEnd) -> str:
    for _ in range(10):
        with suppress(queue.Empty):  # after a node was killed a request or its answer is lost now and then
            return call(other_end, "is_localized", "std_srvs/srv/Trigger", within=WAIT_S / 10)
    raise AssertionError("nobody answers")


def is_heard(other_end: OtherEnd) -> bool:
    other_end.order("matched", TOPICS["/odom"])
    return bool(other_end.wait("matched"))


def drive(other_end: OtherEnd) -> str:
    """Publish the recorded drive until the robot is localised; what the service says then."""
    until(lambda: is_heard(other_end))
    images = 0
    for message in sorted(LogReader(DRIVE).scan(set(TOPICS)), key=lambda record: record.log_time):
        other_end.publish(TOPICS[message.topic], bytes(message.data))
        if message.topic != "/odom":
            images += 1
            if images == 3:  # what runs for the first time is compiled meanwhile
                until(lambda: "nothing has been estimated" not in localised(other_end))
            time.sleep(0.2)
            said = localised(other_end)
            if "success=True" in said:
                return said
    raise AssertionError(f"the drive is over: {said}")


def test_the_node_is_led_through_its_life_and_starts_afresh_after_a_kill(
    other_end: OtherEnd, start: Start, tmp_path: Path, shared_cache: Path
):
    types = LogReader(DRIVE).topics
    for recorded, topic in TOPICS.items():
        other_end.order("advertise", topic, type=types[recorded])
    node = start()
    assert not change(other_end, CONFIGURE)
    log = (tmp_path / "node.log").read_text()
    assert "[omninav]: 1 problem:\n  map: place.omap: there is no such file" in log
    assert "Traceback" not in log

    words = ("learn=map", "variant=omniview_mcl", f"log={TOUR}", "plots=none", f"cache={shared_cache}")
    learnt = run_here(tmp_path, *words)
    assert learnt.returncode == 0, learnt.stderr
    shutil.copy(next((tmp_path / "runs").glob("*_map/*.omap")), tmp_path / "place.omap")
    assert change(other_end, CONFIGURE)
    assert "no run: the node is not active" in localised(other_end)
    assert change(other_end, ACTIVATE)
    assert "searching, nothing has been estimated yet" in localised(other_end)
    assert "tracking, confidence " in drive(other_end)
    pose = "geometry_msgs/msg/PoseWithCovarianceStamped"
    other_end.order("subscribe", "/renamed/pose", type=pose, durability="TRANSIENT_LOCAL")
    assert other_end.hear("/renamed/pose")
    assert change(other_end, DEACTIVATE)
    assert "no run" in localised(other_end)
    assert open_run(tmp_path / "runs/latest").manifest["status"] == "complete"

    assert change(other_end, ACTIVATE)
    assert "tracking" in drive(other_end)
    assert open_run(tmp_path / "runs/latest").manifest["status"] == "running"
    node.kill()
    until(lambda: open_run(tmp_path / "runs/latest").manifest["status"] == "complete")  # its run has ended well
    until(lambda: not is_heard(other_end))  # a request is lost that goes to the node that is gone
    start("-p", "autostart_node:=true")
    assert "tracking" in drive(other_end)
    assert change(other_end, DEACTIVATE)
    assert change(other_end, CLEAN_UP)
    assert "label='unconfigured'" in call(other_end, "get_state", "lifecycle_msgs/srv/GetState")
