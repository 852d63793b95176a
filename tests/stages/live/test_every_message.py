"""Every message that an option of `publish` declares, over every transport, read back by decoders that are not ours."""

import functools
import json
import math
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from omninav.pipeline.cli.composition import complete, composed
from omninav.pipeline.cli.config_groups import group_options
from omninav.stages.live import publish
from omninav.stages.live.publish import Publish, PublishBelief, PublishMessages, register_nav2
from omninav.stages.live.transport import connect
from omninav.stages.plots.result_messages import ResultMessages

from . import every_message
from .conftest import ROS2_PYTHON, WAIT_S, OtherEnd, Wire, ours_for_rclpy

HERE = Path(__file__).parent
Told = list[dict[str, dict[str, Any]]]
"""Options of `publish`: of each, node -> its parameters."""
STAMP = {"sec": 1_700_000_000, "nanosec": 250_000_000}
INSTALLED = ("geometry_msgs", "nav_msgs", "std_msgs", "diagnostic_msgs")
"""Packages of messages that have wheels for rclpy."""
NAV2 = {
    "nav2_msgs/msg/Particle": "geometry_msgs/Pose pose\nfloat64 weight",
    "nav2_msgs/msg/ParticleCloud": "std_msgs/Header header\nParticle[] particles",
}
"""As in nav2's repository: these do not come with ROS."""


@functools.cache
def options() -> Told:
    """The nodes of all options of `publish`, with their parameters; the command also without a header."""
    found = []
    for option in group_options("publish"):
        words = ["variant=topological_nav", "goal=kitchen", "world=office", f"publish={option}"]
        with composed(words) as config:
            nodes = complete(config)["nodes"]
        found.append({name: dict(node) for name, node in nodes.items() if name.startswith("publish")})
        if "messages" in nodes:
            found[-1]["messages"] = {"topics": list(nodes["messages"].get("topics", ResultMessages().topics))}
    bare = {"pose": None, "tf": None, "command": "/cmd_vel_bare", "command_type": "Twist"}
    found.append({"publish": bare})
    return [{name: {k: v for k, v in node.items() if k != "_target_"} for name, node in one.items()} for one in found]


def topics_declared(told: Told) -> dict[str, str]:
    """Topic -> message type of all that these parameters say, and of the diagnostics."""
    found = {"/diagnostics": "diagnostic_msgs/msg/DiagnosticArray"}
    for one in told:
        stage = Publish(**one["publish"])
        named = {stage.pose: "geometry_msgs/msg/PoseWithCovarianceStamped", stage.tf: "tf2_msgs/msg/TFMessage"}
        named[stage.command] = f"geometry_msgs/msg/{stage.command_type}"
        if "publish_belief" in one:
            belief = PublishBelief(**one["publish_belief"])
            packages = {"PoseArray": "geometry_msgs", "ParticleCloud": "nav2_msgs"}
            named[belief.topic] = f"{packages[belief.message]}/msg/{belief.message}"
            shown = PublishMessages(**one["publish_messages"])
            types = {name: every_message.SHOWN[name][0] for name in one["messages"]["topics"]}
            named |= {shown.grid if name == "/grid" else name: kind for name, kind in types.items()}
        found |= {topic: kind for topic, kind in named.items() if topic is not None}
    return found


def plain(value: Any) -> Any:
    """A decoded message as mappings, lists and numbers."""
    if hasattr(value, "__slots__"):
        return {name: plain(getattr(value, name)) for name in value.__slots__}
    return [plain(each) for each in value] if isinstance(value, list) else value


@functools.cache
def decoder_of(msgtype: str) -> Callable[[bytes], Any]:
    """A decoder of the `mcap` project, which shares nothing with omninav's encoder."""
    types = get_typestore(Stores.ROS2_HUMBLE)
    for name, definition in NAV2.items():
        types.register(get_types_from_msg(definition, name))
    definition, _ = types.generate_msgdef(msgtype, ros_version=2)
    decode = DecoderFactory().decoder_for("cdr", Schema(1, definition.encode(), "ros2msg", msgtype))
    assert decode is not None
    return decode


def decoded(msgtype: str, data: bytes) -> Any:
    return plain(decoder_of(msgtype)(data))


def pose(x: float, y: float, heading: float) -> dict[str, Any]:
    turned = {"x": 0.0, "y": 0.0, "z": math.sin(heading / 2), "w": math.cos(heading / 2)}
    return {"position": {"x": x, "y": y, "z": 0.0}, "orientation": turned}


def close(found: Any, wanted: Any, where: str = "") -> None:
    """The fields that are wanted are found; others are not looked at."""
    if isinstance(wanted, dict):
        for name, value in wanted.items():
            close(found[name], value, f"{where}.{name}")
    elif isinstance(wanted, list):
        assert len(found) == len(wanted), where
        for number, value in enumerate(wanted):
            close(found[number], value, f"{where}[{number}]")
    elif isinstance(wanted, float):
        assert found == pytest.approx(wanted, abs=1e-6), where
    else:
        assert found == wanted, where


HEADER = {"stamp": STAMP, "frame_id": "map"}
AT = pose(3.0, 1.0, math.pi / 2)
CLOUD = [AT, pose(2.0, -1.0, 0.0)]
TWIST = {"linear": {"x": 0.25, "y": 0.0, "z": 0.0}, "angular": {"x": 0.0, "y": 0.0, "z": -0.5}}
COVARIANCE = [0.04, *[0.0] * 6, 0.09, *[0.0] * 27, 0.01]
# (3, 1, 90 deg) over the inverse of (1, 2, 180 deg): odometry's origin is at (1, 2), turned by -90 deg
CORRECTION = {
    "translation": {"x": 1.0, "y": 2.0, "z": 0.0},
    "rotation": {"x": 0.0, "y": 0.0, "z": -math.sqrt(0.5), "w": math.sqrt(0.5)},
}
AHEAD = {"header": {"stamp": {**STAMP, "sec": STAMP["sec"] + 1}, "frame_id": "map"}, "child_frame_id": "odom"}
GRID = {
    "header": HEADER,
    "info": {"resolution": 0.5, "width": 3, "height": 1, "origin": pose(1.0, -2.0, 0.0)},
    "data": [0, 100, -1],
}
POSES = {
    "/amcl_pose": {"header": HEADER, "pose": {"pose": AT, "covariance": COVARIANCE}},
    "/tf": {"transforms": [{**AHEAD, "transform": CORRECTION}]},
    "/belief": {"header": HEADER, "poses": CLOUD},
    "/particle_cloud": {
        "header": HEADER,
        "particles": [{"pose": CLOUD[0], "weight": 0.75}, {"pose": CLOUD[1], "weight": 0.25}],
    },
    "/cmd_vel": {"header": {"stamp": STAMP, "frame_id": "base_link"}, "twist": TWIST},
    "/cmd_vel_bare": TWIST,
    "/estimate/path": {"header": HEADER, "poses": [{"header": HEADER, "pose": AT}]},
    "/estimate/confidence": {"data": 0.875},
    "/estimate/state": {"data": "lost"},
    "/plan": {"header": HEADER, "poses": [{"pose": pose(0.5, 1.5, 0.0)}, {"pose": pose(2.5, 3.5, 0.0)}]},
    "/grid": GRID,
    "/homing": {"markers": [{"ns": "homing", "scale": {"x": 1.5}, "pose": {"orientation": {"z": math.sin(0.25)}}}]},
}
WANTED = {**POSES, "/estimate/pose": POSES["/amcl_pose"]}


def test_nothing_that_is_declared_is_left_out_of_this_test():
    topics = topics_declared(options())
    assert topics.keys() - WANTED.keys() == {"/map", "/diagnostics"}
    assert WANTED.keys() <= topics.keys()


def check(topic: str, found: Any) -> None:
    """One message, by its topic. `/map` is the grid in AMCL's place, and else the map's markers."""
    if topic == "/diagnostics":
        (status,) = found["status"]
        assert (np.ravel(status["level"])[0], status["name"], status["message"]) == (1, "omninav", "nothing on /odom")
        assert status["values"][0]["key"] == "rate_hz"
    elif topic == "/map" and "markers" in found:
        places = next(each["points"] for each in found["markers"] if len(each["points"]) == 2)
        close(places, [{"x": 0.5, "y": 1.5}, {"x": 2.5, "y": 3.5}])
    else:
        close(found, GRID if topic == "/map" else WANTED[topic], topic)


@contextmanager
def teller(transport: str, python: str, told: Told, **more: str) -> Iterator[Any]:
    """A process that tells all; its output."""
    words = [python, str(HERE / "every_message.py"), transport, json.dumps(told)]
    process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True, env={**os.environ, **more})
    try:
        yield process.stdout
    finally:
        process.kill()
        process.wait()


@pytest.fixture(params=[0, 1, 2], ids=["ros2 or amcl 0", "ros2 or amcl 1", "a bare command"])
def one(request: pytest.FixtureRequest) -> Told:
    """One option at a time: both say something else on /map."""
    return [options()[request.param]]


def check_all_heard(name: str, told: Told) -> None:
    transport, topics, heard = connect(name), topics_declared(told), dict[str, bytes]()
    for topic, kind in topics.items():
        transport.subscribe(topic, kind)
    until = time.monotonic() + WAIT_S
    with teller(name, sys.executable, told):
        while len(heard) < len(topics) and time.monotonic() < until:
            message = transport.take(0.2)
            if message is not None:
                heard[message.topic] = message.data
    assert sorted(heard) == sorted(topics)
    for topic, data in heard.items():
        check(topic, decoded(topics[topic], data))


def test_over_dds(domain: int, one: Told):
    check_all_heard("dds", one)


def test_over_zenoh(router: object, one: Told):
    register_nav2()  # a subscription's key has the type's hash
    check_all_heard("zenoh", one)


def test_rclpy_reads_what_it_has_types_for(other_end: OtherEnd, one: Told):
    topics = topics_declared(one)
    readable = {topic: kind for topic, kind in topics.items() if kind.partition("/")[0] in INSTALLED}
    with teller("rclpy", str(ROS2_PYTHON), one, PYTHONPATH=ours_for_rclpy()) as output:
        assert set(json.loads(output.readline())["left_out"]) == topics.keys() - readable.keys()
        threading.Thread(target=output.read, daemon=True).start()
        for topic, kind in readable.items():
            other_end.order("subscribe", topic, type=kind, decoded=True)
            check(topic, other_end.said("topic", topic)["message"])


def test_in_this_process(monkeypatch: pytest.MonkeyPatch, one: Told):
    class Bytes(Wire):
        def publish(self, topic, msgtype, data, latched=False):
            self.sent.append((topic, decoded(msgtype, data)))

    wire = Bytes()
    for module in (every_message, publish):
        monkeypatch.setattr(module, "connect", lambda name, domain=None: wire)
    every_message.Told("dds", one).tell()
    assert {topic for topic, _ in wire.sent} == topics_declared(one).keys()
    for topic, message in wire.sent:
        check(topic, message)


def test_a_keystore_that_is_not_there_is_one_line(other_end: OtherEnd, tmp_path: Path):
    secured = {
        "ROS_SECURITY_ENABLE": "true",
        "ROS_SECURITY_STRATEGY": "Enforce",
        "ROS_SECURITY_KEYSTORE": str(tmp_path),
    }
    script = "from omninav.stages.live.transport import *\ntry: connect('rclpy')\nexcept TransportError as e: print(e)"
    words = [str(ROS2_PYTHON), "-c", script]
    environment = {**os.environ, **secured, "PYTHONPATH": ours_for_rclpy()}
    ended = subprocess.run(words, capture_output=True, text=True, env=environment, timeout=WAIT_S)
    assert ended.stdout.startswith("transport=rclpy: domain ")
    assert "SECURITY ERROR" in ended.stdout
