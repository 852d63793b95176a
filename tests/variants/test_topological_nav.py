"""From a map of pictures to a goal, in the small built-in world, as a user runs it."""

import json
import math
import re
from functools import partial
from pathlib import Path

import pytest
from background_runs import assert_same_bytes, whole_and_resumed
from golden_figures import SMALL_CAMERA

from omninav.pipeline.engine.artifact import read_artifact
from omninav.stages.values.topological_map import TopologicalMap

WORDS = ("variant=topological_nav", "world=home_store_demo", *SMALL_CAMERA)


def metrics_of(place: Path) -> dict:
    return json.loads((place / "runs" / "latest" / "metrics.json").read_text())


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory, shared_cache: Path) -> tuple[Path, Path]:
    words = (*WORDS, "goal=3", "nodes.source.seconds=40", f"cache={shared_cache}")
    return whole_and_resumed(tmp_path_factory.mktemp("navigation"), *words, ticks=60)


@pytest.fixture
def navigate(omninav, shared_cache: Path):
    """Runs the variant in the small world, whose map is made once."""
    return partial(omninav, *WORDS, f"cache={shared_cache}")


def test_a_robot_that_does_not_know_where_it_is_drives_to_a_place_and_docks_there(runs: tuple[Path, Path]):
    metrics = json.loads((runs[0] / "metrics.json").read_text())
    found = metrics["navigation"]
    assert found["reached"]
    assert found["collisions"] == 0
    assert found["end_error_m"] < 0.11  # the paper's homing
    assert found["path_length_m"] < 2.0 * found["shortest_m"]
    assert metrics["frames"] <= 5 * (found["time_s"] + 1.4)  # the drive is over when the way is


def test_killed_on_its_way_it_goes_on_to_the_same_bytes(runs: tuple[Path, Path]):
    assert_same_bytes(*runs, "metrics.json", "result.mcap", "trajectory.tum")


def test_a_picture_taken_elsewhere_on_the_floor_is_a_goal(omninav, navigate, tmp_path: Path):
    words = ("nodes.source.start=[4.2,4.0,0.5]", "nodes.source.seconds=0.2")
    omninav("variant=wander", *SMALL_CAMERA, *words, check=True)
    navigate("goal=runs/latest/image.png", "nodes.source.seconds=3", check=True)
    found = metrics_of(tmp_path)["navigation"]
    assert found["state"] == "under way"
    map = read_artifact(tmp_path / "runs" / "latest" / "map.omap")
    assert isinstance(map, TopologicalMap)
    assert math.dist(map.poses[map.places[found["goal"]]][:2], (4.2, 4.0)) < 1.0


@pytest.mark.parametrize(
    ("goal", "said"),
    [
        ("elsewhere.png", "goal: there is no file elsewhere.png"),
        ("kitchen", "goal: the map (has|will have) no place"),
        ("99", "goal: the map (has|will have) no place"),
    ],
)
def test_a_goal_that_is_no_file_or_not_in_the_map_is_refused(navigate, goal: str, said: str):
    ended = navigate(f"goal={goal}", "nodes.source.seconds=2")
    assert ended.returncode != 0
    assert re.search(said, ended.stderr)
    assert "Traceback" not in ended.stderr


def test_what_nothing_reads_is_refused(omninav):
    ended = omninav("check", "variant=homing", "goal=kitchen", "tour=tour.mcap")
    assert ended.returncode != 0
    for key in ("tour", "goal"):
        assert f"{key}: homing does not take it" in ended.stderr
