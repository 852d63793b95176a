"""The closed loop as a user runs it: whole, and killed on the way."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from omninav.pipeline.log import LogReader

WORDS = ("variant=wander", "nodes.source.seconds=8", "checkpoint_s=0.1", "cache=null")


def start(place: Path, *words: str) -> subprocess.Popen[bytes]:
    place.mkdir(exist_ok=True)
    command = [sys.executable, "-m", "omninav.pipeline", *words]
    return subprocess.Popen(
        command, cwd=place, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("wander")
    assert start(place, *WORDS).wait(timeout=300) == 0
    return place / "runs" / "latest"


def test_a_robot_wanders_without_a_contact_and_every_command_is_in_the_result(whole: Path):
    metrics = json.loads((whole / "metrics.json").read_text())
    assert metrics["frames"] == 40
    assert metrics["drive"]["collisions"] == 0
    assert metrics["drive"]["distance_m"] > 2.0
    log = LogReader(whole / "result.mcap")
    commands = [message.content.twist.linear.x for message in log.messages(["/command"])]
    assert len(commands) == 40
    assert max(commands) == pytest.approx(0.4)
    assert log.topics["/command"] == "geometry_msgs/msg/TwistStamped"
    report = (whole / "report.html").read_text()
    assert "Where it drove" in report
    assert "What the robot saw" in report


def test_a_killed_closed_loop_resumes_to_the_same_bytes(whole: Path, tmp_path: Path):
    process = start(tmp_path, *WORDS)
    checkpoint = None
    while checkpoint is None and process.poll() is None:
        time.sleep(0.02)
        checkpoint = next(tmp_path.glob("runs/*/checkpoints/checkpoint"), None)
    time.sleep(0.5)
    assert process.poll() is None, "it was over before it could be killed"
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    assert start(tmp_path, "resume", "runs/latest").wait(timeout=300) == 0
    for name in ("metrics.json", "result.mcap"):
        assert (tmp_path / "runs" / "latest" / name).read_bytes() == (whole / name).read_bytes(), name
