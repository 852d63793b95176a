"""The closed loop as a user runs it: whole, and killed on the way."""

import json
from pathlib import Path

import pytest
from background_runs import assert_same_bytes, whole_and_resumed

from omninav.pipeline.mcap.reader import LogReader

WORDS = ("variant=wander", "nodes.source.seconds=8", "cache=null")


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    return whole_and_resumed(tmp_path_factory.mktemp("wander"), *WORDS, ticks=20)


def test_a_robot_wanders_without_a_contact_and_every_command_is_in_the_result(runs: tuple[Path, Path]):
    whole, _ = runs
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
    assert "Path driven" in report
    assert "Frame by frame" in report


def test_a_killed_closed_loop_resumes_to_the_same_bytes(runs: tuple[Path, Path]):
    assert_same_bytes(*runs, "metrics.json", "result.mcap")
