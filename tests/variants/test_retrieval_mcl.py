"""Localisation by retrieved images and visibility areas: as a user runs it, and stage by stage in exchange."""

import json
from pathlib import Path

import pytest
from conftest import DRIVE, GRID, TOUR

from omninav.pipeline.cli.composition import complete, composed
from omninav.pipeline.graph.problems import ProblemsFound
from omninav.pipeline.run.prepared_run import prepare_run


def prepared(*words: str):
    with composed(words) as config:
        return prepare_run(complete(config))


@pytest.mark.parametrize("v", [0, 1])
@pytest.mark.parametrize("f", [0, 1])
@pytest.mark.parametrize("m", [0, 1])
def test_each_stage_of_one_variant_serves_the_other(v: int, f: int, m: int):
    """Eight of the 32 combinations, among which any two of the stages occur together."""
    variant, features = ("retrieval_mcl", "omniview_mcl")[v], ("haar_integral", "hsv_histogram")[f]
    match, sensor = ("retrieval", "selective")[m], ("visibility", "near_references")[v ^ f]
    fusion = ("uniform_recovery", "importance_resampling")[v ^ m]
    words = (f"features={features}", f"match={match}", f"sensor={sensor}", f"fusion={fusion}", "plots=all")
    graph = prepared(f"variant={variant}", *words).graph
    assert ("visibility_areas" in graph.nodes) == (sensor == "visibility")
    answers = [wire for wire in graph.wires if wire.to_port == "answers"]
    assert bool(answers) == (match == "retrieval")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("features=hsv_histogram", "unwarp=window"), "is of type Windows"),
        (("features=fourier",), "has no output 'features'"),
        (("fusion=conditional_resampling",), "hypothesis"),
    ],
    ids=["a window for who wants a circle", "features of another kind", "a fusion of another kind"],
)
def test_what_cannot_be_exchanged_is_explained_before_anything_runs(words: tuple[str, ...], said: str):
    with pytest.raises(ProblemsFound) as found:
        prepared("variant=retrieval_mcl", *words)
    assert said in str(found.value)


def test_what_is_proposed_is_drawn_anew_at_each_image():
    graph = prepared("variant=retrieval_mcl", f"tour={TOUR}", f"log={DRIVE}", f"grid={GRID}").graph
    assert graph.nodes["proposals"].lifetime == "tick"


def test_who_is_carried_on_its_drive_is_not_carried_on_its_tour():
    with composed(["variant=retrieval_mcl", "cuts=[[3,6]]", "kidnappings=[{at: 30.0, turn: 1.5}]"]) as config:
        config = complete(config)
    drive = config["nodes"]["source"]
    assert (drive["cuts"], drive["kidnappings"]) == ([[3, 6]], [{"at": 30.0, "turn": 1.5}])
    for name in ("map", "thumbnails"):
        tour = config["artifacts"][name]["graph"]["nodes"]["source"]
        assert (tour["cuts"], tour["kidnappings"]) == ([], [])


def test_without_a_grid_one_line_says_what_is_missing_and_how_to_get_one(omninav, tmp_path: Path):
    ended = omninav("variant=retrieval_mcl", f"tour={TOUR}", f"log={DRIVE}")
    assert ended.returncode == 2
    assert len(ended.stderr.strip().splitlines()) == 1
    assert f"grid={GRID}" in ended.stderr
    assert "grid=from_tour" in ended.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_robot_that_starts_anywhere_finds_itself_by_a_stand_in_for_the_grid(
    omninav, shared_cache: Path, tmp_path: Path
):
    words = ("variant=retrieval_mcl", f"tour={TOUR}", f"log={DRIVE}", "grid=from_tour", "plots=all")
    omninav(*words, f"cache={shared_cache}", check=True)
    run = (tmp_path / "runs" / "latest").resolve()
    metrics = json.loads((run / "metrics.json").read_text())
    after = metrics["after_convergence"]
    assert after["position_error_m"]["median"] < 0.5
    assert after["position_error_m"]["max"] < 2.0
    assert after["heading_error_deg"]["median"] < 8.0
    assert metrics["visibility"]["grid"] == "tour"
    report = (run / "report.html").read_text()
    assert all(words in report for words in ("Visibility areas", "match 3: ", "The grid is a stand-in"))
