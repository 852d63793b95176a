"""Robots of the tests' own, and real rclpy at the other end, in an environment of its own."""

import base64
import functools
import itertools
import json
import os
import queue
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from conflicting_logs import ticks
from conftest import DRIVE, ROOT

import omninav
from omninav.pipeline import Context
from omninav.pipeline.api.run import Run
from omninav.pipeline.mcap.message_types import make_message, standard_types
from omninav.pipeline.mcap.reader import LogReader
from omninav.stages.live import live_source, publish, time_synchronizer, watchdog
from omninav.stages.live.transport import RawMessage, Transport, disconnect
from omninav.stages.source.log import LogSource

CAMERA = ROOT / "tests/data/camera.yaml"
IMAGE, ODOMETRY, TRUTH = "/camera/image/compressed", "/odom", "/ground_truth/pose"
ROS2_PYTHON = Path(os.environ.get("OMNINAV_ROS2_PYTHON", ROOT / ".venv-ros2/bin/python"))
WAIT_S = 180.0
"""Until what does not happen has failed: a busy machine is slow."""
_DOMAINS = itertools.count(10 + (os.getpid() * 7) % 80)
"""A domain for each test, so that neither tests nor a robot in the room hear each other."""


def encode(msgtype: str, fields: dict[str, Any], stamp: int | None = None) -> bytes:
    """A message's CDR."""
    return bytes(standard_types().serialize_cdr(make_message(msgtype, fields, stamp), msgtype))


def decode(msgtype: str, data: bytes) -> Any:
    """A message of its CDR."""
    return standard_types().deserialize_cdr(data, msgtype)


class Wire(Transport):
    """A transport that keeps what is sent, and gives what a test puts into its queue."""

    def __init__(self) -> None:
        super().__init__()
        self.place, self.status.live = "a test", True
        self.sent: list[tuple[str, Any]] = []
        self.there: dict[str, str] = {}

    def subscribe(self, topic, msgtype, newest=False, latched=False):
        self.queue.open(topic, newest)

    def publish(self, topic, msgtype, data, latched=False):
        self.sent.append((topic, decode(msgtype, data)))

    def offered(self):
        return self.there

    def close(self):
        """Nothing is open."""

    def on(self, topic):
        return [message for each, message in self.sent if each == topic]


class Recorded(Wire):
    """A robot that says what a recorded one said, `at_once` messages whenever it is listened to, by a clock of its own.

    `silent`: images that never come.
    """

    def __init__(self, drive: Path = DRIVE, at_once: int = 50, silent: range = range(0)) -> None:
        super().__init__()
        self.now_s = 0.0
        self._script = self._messages(drive, at_once, silent)

    def take(self, timeout_s=0.0):
        return next(self._script, None)

    def _messages(self, drive: Path, at_once: int, silent: range) -> Iterator[RawMessage | None]:
        images = itertools.count()
        for number, message in enumerate(recorded(drive, IMAGE, ODOMETRY, TRUTH)):
            self.now_s = message.received / 1e9
            if message.topic != IMAGE or next(images) not in silent:
                yield message
            if number % at_once == 0:
                yield None


def recorded(drive: Path, *topics: str) -> list[RawMessage]:
    """Gives the messages of a recorded robot on these topics (none: on all), in the order of their arrival."""
    reader = LogReader(drive)
    types = reader.topics
    records = sorted(reader.scan(set(topics) or None), key=lambda record: record.log_time)
    return [RawMessage(each.topic, types[each.topic], each.log_time, bytes(each.data)) for each in records]


def joined(monkeypatch: pytest.MonkeyPatch, robot: Wire) -> None:
    """Have every stage join this robot."""
    for module in (live_source, publish):
        monkeypatch.setattr(module, "connect", lambda name, domain: robot)
    monkeypatch.setattr(live_source, "disconnect", lambda: None)


@pytest.fixture
def wire(monkeypatch: pytest.MonkeyPatch) -> Wire:
    """A transport of the test's own, which every stage joins."""
    made = Wire()
    joined(monkeypatch, made)
    return made


@pytest.fixture
def now(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """A clock that stands until a test moves it: a busy machine is not late."""
    moment = [1000.0]
    for module in (time_synchronizer, watchdog):
        monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: moment[0]))
    return moment


@pytest.fixture
def localised(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, shared_cache: Path) -> Callable[..., Run]:
    """A live run of a variant on a robot, by the robot's clock."""

    def run(robot: Recorded, variant: str, *settings: str) -> Run:
        joined(monkeypatch, robot)
        for module in (live_source, time_synchronizer):
            monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: robot.now_s))
        words = ("source=live", "publish=ros2", "log=live", f"camera={CAMERA}", "plots=none", *settings)
        return omninav.run(variant, *words, folder=tmp_path / "run", cache=shared_cache, progress=False)

    return run


def replayed(record: Path, **parameters: Any) -> list[Any]:
    """Every tick of a record."""
    return list(ticks(LogSource(log=str(record), **parameters), Context("source")))


def same(driven: list[Any], played: list[Any]) -> None:
    """Ticks of a drive and of its record are the same."""
    assert len(driven) == len(played) > 0
    for one, other in zip(driven, played, strict=True):
        assert vars(one.tick) == vars(other.tick)
        assert one.image.pixels.tobytes() == other.image.pixels.tobytes()
        for name in ("odometry", "motion", "truth", "restart", "goal"):
            mine, theirs = getattr(one, name), getattr(other, name)
            assert mine is theirs is None or (type(mine), vars(mine)) == (type(theirs), vars(theirs)), name


class OtherEnd:
    """A ROS 2 node in a process of its own."""

    def __init__(self, domain: int) -> None:
        environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
        command = [str(ROS2_PYTHON), str(Path(__file__).parent / "rclpy_end.py")]
        self.process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=environment | {"ROS_DOMAIN_ID": str(domain)},
        )
        self._heard: queue.Queue[dict[str, Any]] = queue.Queue()
        threading.Thread(target=self._read, daemon=True).start()
        self.wait("ready")

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self._heard.put(json.loads(line))

    def order(self, do: str, topic: str = "", **rest: Any) -> None:
        """Have it do something."""
        assert self.process.stdin is not None
        self.process.stdin.write(json.dumps({"do": do, "topic": topic, **rest}) + "\n")
        self.process.stdin.flush()

    def publish(self, topic: str, data: bytes) -> None:
        """Have it publish CDR on a topic that it has advertised."""
        self.order("publish", topic, data=base64.b64encode(data).decode())

    def said(self, key: str, value: object = None, within: float = WAIT_S) -> dict[str, Any]:
        """The next thing that it says with that key, and that value where one is given."""
        until = time.monotonic() + within
        while True:
            said = self._heard.get(timeout=max(0.01, until - time.monotonic()))
            if key in said and value in (None, said[key]):
                return said

    def wait(self, key: str, within: float = WAIT_S) -> Any:
        """The next thing that it says with that key."""
        return self.said(key, within=within)[key]

    def hear(self, topic: str) -> bytes:
        """The next message that it hears on a topic."""
        return base64.b64decode(self.said("topic", topic)["data"])

    def close(self) -> None:
        """End it."""
        assert self.process.stdin is not None
        self.process.stdin.close()
        self.process.kill()
        self.process.wait(timeout=10)


@pytest.fixture
def domain(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """A ROS domain of the test's own; whatever was opened in it is closed."""
    number = next(_DOMAINS)
    monkeypatch.setenv("ROS_DOMAIN_ID", str(number))
    yield number
    disconnect()


@pytest.fixture
def router(monkeypatch: pytest.MonkeyPatch) -> Iterator[object]:
    """As `ros2 run rmw_zenoh_cpp rmw_zenohd` starts one, at a port of the test's own."""
    zenoh = pytest.importorskip("zenoh")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        place = json.dumps([f"tcp/127.0.0.1:{free.getsockname()[1]}"])
    settings = zenoh.Config()
    for key, value in (("mode", '"router"'), ("listen/endpoints", place), ("scouting/multicast/enabled", "false")):
        settings.insert_json5(key, value)
    monkeypatch.setenv("ZENOH_CONFIG_OVERRIDE", f"connect/endpoints={place}")
    with zenoh.open(settings) as session:
        yield session
        disconnect()


@functools.cache
def _has_rclpy() -> bool:
    words = [str(ROS2_PYTHON), "-c", "import rclpy, std_srvs"]
    return ROS2_PYTHON.exists() and subprocess.run(words, stderr=subprocess.DEVNULL, timeout=60).returncode == 0


@functools.cache
def _of_one_python(libraries: str) -> bool:
    words, environment = [str(ROS2_PYTHON), "-c", "import cv2"], os.environ | {"PYTHONPATH": libraries}
    return subprocess.run(words, env=environment, stderr=subprocess.DEVNULL, timeout=60).returncode == 0


def ours_for_rclpy() -> str:
    """PYTHONPATH by which rclpy's Python imports omninav and its packages; skips the test where they do not load."""
    libraries = f"{ROOT}{os.pathsep}{Path(np.__file__).parents[1]}"
    if not _of_one_python(libraries):
        pytest.skip(f"{ROS2_PYTHON} and {sys.executable} are not of one Python: their libraries do not go together")
    return libraries


@pytest.fixture
def other_end(domain: int) -> Iterator[OtherEnd]:
    """A node of real rclpy."""
    if not _has_rclpy():
        pytest.skip(f"no rclpy at {ROS2_PYTHON}: type `make ros2` (Python 3.11), or set OMNINAV_ROS2_PYTHON")
    end = OtherEnd(domain)
    yield end
    end.close()


def until(true: Any, timeout_s: float = WAIT_S) -> None:
    """Wait until something is so."""
    end = time.monotonic() + timeout_s
    while not true():
        assert time.monotonic() < end, "it did not happen in time"
        time.sleep(0.02)
