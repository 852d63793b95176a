"""Visual words are learned with a map and find its references."""

import json
from pathlib import Path

import pytest
from background_runs import assert_same_bytes, finished, whole_and_resumed
from conftest import DRIVE, TOUR

from omninav.pipeline.cli.composition import complete, composed
from omninav.pipeline.engine.artifact import read_artifact
from omninav.pipeline.run.prepared_run import prepare_run
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.visual_words import VisualWords

FOUND = ("candidates=words", f"log={DRIVE}", "nodes.candidates.compare_all_up_to=0", "plots=none")
MADE = ("variant=omniview_mcl", *FOUND, f"tour={TOUR}", "nodes.source.stop=12")
MAPPING = "+artifacts.map.nodes.mapping"
TYPED = {
    **dict.fromkeys(("omninav", "omniview_mcl_as_printed", "plain_matching"), f"{MAPPING}.distance_m=0.7"),
    "retrieval_mcl": f"{MAPPING}.min_distance_m=0.7",
    "omniview_mcl": f"{MAPPING}.min_distance_m=0.7 artifacts.map.choices.mapping=image_database "
    "tour_settings.cuts=[[10,20]]",
}
"""Variants that localise in a map of references, with words that change the map."""


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    return whole_and_resumed(tmp_path_factory.mktemp("words"), *MADE, "cache=null", ticks=10)


@pytest.fixture
def made(runs: tuple[Path, Path]) -> Path:
    return runs[0]


def test_killed_while_learning_it_goes_on_to_the_same_bytes(runs: tuple[Path, Path]) -> None:
    assert_same_bytes(*runs, "map.omap", "words.omap")
    map, learned = (read_artifact(runs[0] / f"{artifact}.omap") for artifact in ("map", "words"))
    assert isinstance(map, ReferenceGraph)
    assert isinstance(learned, VisualWords)
    assert len(learned) == len(map)


def test_a_saved_map_is_used_with_its_words(made: Path, tmp_path: Path) -> None:
    saved = (f"map={made / 'map.omap'}", f"words={made / 'words.omap'}", "nodes.source.stop=6")
    run = finished(tmp_path, "variant=omniview_mcl", *FOUND, *saved)
    assert (run / "words.omap").read_bytes() == (made / "words.omap").read_bytes()
    assert json.loads((run / "metrics.json").read_text())["frames"] == 6


@pytest.mark.parametrize("variant", TYPED)
def test_what_is_typed_for_a_map_is_of_its_words_too(variant: str) -> None:
    with composed([f"variant={variant}", "candidates=words", *TYPED[variant].split()]) as config:
        made = {artifact.name: artifact.graph for artifact in prepare_run(complete(config)).artifacts}
    map, words = made["map"], made["words"]
    assert map is not None
    assert words is not None
    assert 0.7 in map.nodes["mapping"].parameters.values()
    for node in ("source", "mapping"):
        assert type(words.nodes[node].stage) is type(map.nodes[node].stage)
        assert words.nodes[node].parameters == map.nodes[node].parameters
    assert bool(map.nodes["source"].parameters["cuts"]) == (variant == "omniview_mcl")


@pytest.mark.parametrize(
    ("given", "missing"), [("map", "type words=FILE.omap too"), ("words", "type map=FILE.omap too")]
)
def test_one_without_the_other_is_refused_in_one_line(given: str, missing: str, made: Path, omninav) -> None:
    ended = omninav("check", "variant=omniview_mcl", *FOUND, f"{given}={made / given}.omap")
    assert ended.returncode == 2
    assert missing in ended.stderr
    assert "Traceback" not in ended.stderr


def test_a_variant_whose_map_has_no_references_is_told_what_is_missing(omninav) -> None:
    ended = omninav("check", "variant=particle_cml_baseline", "candidates=words")
    assert ended.returncode == 2
    assert "node 'mapping' (SupervisedViews) has no output 'events'" in ended.stderr
