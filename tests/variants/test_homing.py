"""Homing in a closed loop as a user runs it: whole, and killed on the way."""

import json
from pathlib import Path

import pytest
from background_runs import assert_same_bytes, whole_and_resumed
from golden_figures import SMALL_CAMERA

from omninav.pipeline.mcap.reader import LogReader

WORDS = (
    "variant=homing",
    *SMALL_CAMERA,
    "nodes.source.seconds=16",
    "nodes.source.start=[5.0,5.0,0.4]",
    "kidnappings=[{at: 0.5, to: [4.0, 4.2, 1.5]}]",
    "cache=null",
)


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    place = tmp_path_factory.mktemp("homing")
    return whole_and_resumed(place, *WORDS, ticks=30)  # the local map has been made


@pytest.fixture
def whole(runs: tuple[Path, Path]) -> Path:
    return runs[0]


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


def test_the_report_shows_what_it_followed_frame_by_frame(whole: Path):
    page = (whole / "report.html").read_text()
    data = page.split('data-slides="frame_by_frame"')[1].split('"application/json">')[1]
    slides = json.loads(data.split("</script>")[0])
    captions = [caption for slide in slides["slides"] for caption, _ in slide["photographs"]]
    assert "target: the start" in captions


def test_killed_on_its_way_it_goes_on_to_the_same_bytes(runs: tuple[Path, Path]):
    assert_same_bytes(*runs, "metrics.json", "result.mcap")


WARPED = (
    "variant=homing_field",
    "homing=warping",
    *SMALL_CAMERA,
    "nodes.source.target=[5.0,5.0,0.4]",
    "nodes.source.spacing_m=0.4",
    "nodes.source.radius_m=1.2",
    "nodes.local_map.max_false_alarms=1e-300",  # no features ever suffice
    "cache=null",
    "plots=none",
)


def test_warping_finds_the_target_without_features_and_goes_on_to_the_same_bytes(tmp_path: Path):
    whole, resumed = whole_and_resumed(tmp_path / "run", *WARPED, ticks=4)
    field = json.loads((whole / "metrics.json").read_text())["homing_field"]
    assert field["found_rate"] == 1.0
    assert field["median_deg"] < 10.0
    assert_same_bytes(resumed, whole, "metrics.json")
