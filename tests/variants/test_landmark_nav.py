"""From a map of landmarks to where an image was taken, in the small built-in world, as a user runs it."""

import json
import math
from pathlib import Path

import pytest
from background_runs import assert_same_bytes, whole_and_resumed
from conftest import TOUR
from golden_figures import DATA, SMALL_CAMERA, write_goal

from omninav.pipeline.mcap.reader import LogReader

WORDS = ("variant=landmark_nav", "world=home_store_demo", *SMALL_CAMERA, f"tour={TOUR}", "goal=goal.png")


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory, shared_cache: Path) -> tuple[Path, Path]:
    place = tmp_path_factory.mktemp("landmarks")
    write_goal(place)
    return whole_and_resumed(place, *WORDS, "nodes.source.seconds=40", f"cache={shared_cache}", ticks=40)


@pytest.fixture
def whole(runs: tuple[Path, Path]) -> Path:
    return runs[0]


def test_a_robot_that_does_not_know_where_it_is_stops_where_the_image_was_taken(whole: Path):
    found = json.loads((whole / "metrics.json").read_text())["navigation"]
    assert found["state"] == "arrived"
    assert found["end_error_m"] < 0.05
    assert found["collisions"] == 0
    assert found["path_length_ratio"] < 1.5
    truth = [m.content.pose.position for m in LogReader(whole / "result.mcap").messages(["/ground_truth/pose"])]
    assert math.dist((truth[-1].x, truth[-1].y), write_goal(whole)) < 0.05  # and not only where it took the goal to be


def test_killed_on_its_way_it_goes_on_to_the_same_bytes(runs: tuple[Path, Path]):
    assert_same_bytes(*runs, "metrics.json", "result.mcap", "trajectory.tum")


def test_a_name_is_no_goal_since_the_map_has_no_places(omninav):
    ended = omninav("check", "variant=landmark_nav", "world=home_store_demo", "goal=kitchen")
    assert ended.returncode != 0
    assert "goal: kitchen is no image, and the map has no places; type goal=IMAGE.png" in ended.stderr


def test_a_robot_that_runs_now_takes_the_map_and_the_goal(omninav, whole: Path, tmp_path: Path):
    write_goal(tmp_path)
    given = (f"map={whole / 'map.omap'}", f"camera={DATA / 'camera.yaml'}", "goal=goal.png")
    omninav("check", "variant=landmark_nav", "source=live", "log=live", *given, check=True)
