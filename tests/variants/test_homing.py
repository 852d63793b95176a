"""Homing in a closed loop as a user runs it: whole, and killed on the way."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from omninav.pipeline.log import LogReader

WORDS = (
    "variant=homing",
    "nodes.source.seconds=16",
    "nodes.source.start=[5.0,5.0,0.4]",
    "events=[{at: 0.5, to: [4.0, 4.2, 1.5]}]",
    "checkpoint_s=0.1",
    "cache=null",
)


def start(place: Path, *words: str) -> subprocess.Popen[bytes]:
    place.mkdir(exist_ok=True)
    command = [sys.executable, "-m", "omninav.pipeline", *words]
    return subprocess.Popen(
        command, cwd=place, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("homing")
    assert start(place, *WORDS).wait(timeout=300) == 0
    return place / "runs" / "latest"


def test_a_robot_that_was_carried_away_comes_back_and_stands_as_before(whole: Path):
    metrics = json.loads((whole / "metrics.json").read_text())
    homing = metrics["homing"]
    assert homing["start_m"] == pytest.approx(1.28, abs=0.02)
    assert homing["arrived"] == 1
    assert homing["end_error_m"] < 0.11  # the paper's mean after 3 m
    assert homing["end_turn_deg"] < 5.0
    assert homing["first"]["direction_error_deg"] < 5.0
    assert metrics["drive"]["collisions"] == 0
    commands = [m.content.twist.linear.x for m in LogReader(whole / "result.mcap").messages(["/command"])]
    assert commands[-1] == 0.0
    assert 0.3 < max(commands) <= 0.4


def test_killed_on_its_way_it_goes_on_to_the_same_bytes(whole: Path, tmp_path: Path):
    process = start(tmp_path, *WORDS)
    checkpoint = None
    while checkpoint is None and process.poll() is None:
        time.sleep(0.02)
        checkpoint = next(tmp_path.glob("runs/*/checkpoints/checkpoint"), None)
    time.sleep(4.0)  # the local map has been made
    assert process.poll() is None, "it was over before it could be killed"
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    assert start(tmp_path, "resume", "runs/latest").wait(timeout=300) == 0
    for name in ("metrics.json", "result.mcap"):
        assert (tmp_path / "runs" / "latest" / name).read_bytes() == (whole / name).read_bytes(), name
