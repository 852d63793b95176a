"""From a map of pictures to a goal, in the small built-in world, as a user runs it."""

import json
import math
import re
from functools import partial
from pathlib import Path

import pytest
from background_runs import assert_same_bytes, finished, killed_and_resumed
from conftest import DATA, DRIVE, TOUR, needs_data
from golden_figures import SMALL_CAMERA

from omninav.pipeline.engine.artifact import read_artifact
from omninav.pipeline.graph.ground_truth import truth_in_the_loop
from omninav.stages.values.topological_map import TopologicalMap

HOUSE = DATA / "photoreal-house"
WORDS = ("variant=topological_nav", "world=home_store_demo", *SMALL_CAMERA)
SECONDS = ("nodes.source.seconds=40", "checkpoint_s=0.5")
KILLED = ("nodes.source.seconds=12", "checkpoint_s=0.5")


def metrics_of(place: Path) -> dict:
    return json.loads((place / "runs" / "latest" / "metrics.json").read_text())


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory, shared_cache: Path) -> Path:
    return finished(tmp_path_factory.mktemp("navigation"), *WORDS, "goal=3", *SECONDS, f"cache={shared_cache}")


@pytest.fixture
def navigate(omninav, shared_cache: Path):
    """Runs the variant in the small world, whose map is made once."""
    return partial(omninav, *WORDS, f"cache={shared_cache}")


def test_a_robot_that_does_not_know_where_it_is_drives_to_a_place_and_docks_there(whole: Path):
    metrics = json.loads((whole / "metrics.json").read_text())
    found = metrics["navigation"]
    assert found["reached"]
    assert found["collisions"] == 0
    assert found["end_error_m"] < 0.11  # the paper's homing
    assert found["path_length_m"] < 2.0 * found["shortest_m"]
    assert metrics["frames"] <= 5 * (found["time_s"] + 1.4)  # the drive is over when the way is


def test_killed_on_its_way_it_goes_on_to_the_same_bytes(tmp_path: Path, shared_cache: Path):
    words = (*WORDS, "goal=3", *KILLED, f"cache={shared_cache}")
    run = killed_and_resumed(tmp_path / "killed", *words, ticks=20)
    assert_same_bytes(run, finished(tmp_path / "whole", *words), "metrics.json", "result.mcap", "trajectory.tum")


def test_a_picture_taken_elsewhere_on_the_floor_is_a_goal(omninav, navigate, tmp_path: Path):
    words = ("nodes.source.start=[4.2,4.0,0.5]", "nodes.source.seconds=0.2")
    omninav("variant=wander", *SMALL_CAMERA, *words, check=True)
    navigate("goal=runs/latest/image.png", "nodes.source.seconds=3", check=True)
    found = metrics_of(tmp_path)["navigation"]
    assert found["state"] == "under way"
    map = read_artifact(tmp_path / "runs" / "latest" / "map.omap")
    assert isinstance(map, TopologicalMap)
    assert math.dist(map.poses[map.places[found["goal"]]][:2], (4.2, 4.0)) < 1.0


def test_a_goal_that_is_no_file_is_refused_before_anything_runs(navigate, tmp_path: Path):
    ended = navigate("goal=elsewhere.png", "nodes.source.seconds=2")
    assert ended.returncode != 0
    assert "goal: there is no file elsewhere.png" in ended.stderr
    assert "Traceback" not in ended.stderr


@pytest.mark.parametrize("goal", ["kitchen", "99"])
def test_a_goal_that_the_map_does_not_have_is_refused_in_one_line(navigate, tmp_path: Path, goal: str):
    ended = navigate(f"goal={goal}", "nodes.source.seconds=2")
    assert ended.returncode != 0
    assert re.search("goal: the map (has|will have) no place", ended.stderr)
    assert "Traceback" not in ended.stderr


def test_what_nothing_reads_is_refused(omninav):
    ended = omninav("check", "variant=homing", "goal=kitchen", "tour=tour.mcap")
    assert ended.returncode != 0
    for key in ("tour", "goal"):
        assert f"{key}: homing does not take it" in ended.stderr


def test_without_a_goal_it_is_said_before_anything_runs(omninav):
    ended = omninav("check", *WORDS)
    assert ended.returncode != 0
    assert "goal: topological_nav needs it: where to go" in ended.stderr


def test_nothing_that_steers_the_robot_knows_the_truth():

    from omninav.pipeline.cli.composition import complete, composed
    from omninav.pipeline.run.plan import plan

    with composed([*WORDS, "goal=3"]) as config:
        graph = plan(complete(config)).graph
    assert list(truth_in_the_loop(graph)) == []


@pytest.mark.parametrize(
    ("tour", "log", "stride", "images"),
    [
        pytest.param(TOUR, DRIVE, 2, 26, id="a store"),
        pytest.param(HOUSE / "tour.mcap", HOUSE / "drive.mcap", 3, 44, id="a house", marks=needs_data),
    ],
)
def test_a_drive_is_known_by_its_places(omninav, tmp_path: Path, tour: Path, log: Path, stride: int, images: int):
    words = ("variant=topological_localisation", f"tour={tour}", f"log={log}", f"nodes.source.stride={stride}")
    omninav(*words, check=True)
    found = metrics_of(tmp_path)["localisation"]
    assert found["images"] == images
    assert found["adjacent_accuracy"] > 0.7
    assert found["place_distance_m"] < 1.0
    assert (tmp_path / "runs" / "latest" / "trajectory.tum").exists()
