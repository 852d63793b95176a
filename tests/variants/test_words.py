"""Visual words are learned with a map and find its references."""

import json
from pathlib import Path

import pytest
from background_runs import assert_same_bytes, finished, whole_and_resumed
from conftest import DRIVE, TOUR

import omninav
from omninav.pipeline.cli.composition import complete, composed
from omninav.pipeline.engine.artifact import read_artifact
from omninav.pipeline.run.prepared_run import prepare_run
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.visual_words import VisualWords

FOUND = ("candidates=words", f"log={DRIVE}", "nodes.candidates.compare_all_up_to=0", "plots=none")
MADE = ("variant=omniview_mcl", *FOUND, f"tour={TOUR}", "nodes.source.stop=12")
MAPPING = "+artifacts.map.nodes.mapping"
DISTANCES = {
    "omninav": "distance_m",
    "omniview_mcl": "distance_m",
    "omniview_mcl_as_printed": "distance_m",
    "plain_matching": "distance_m",
    "retrieval_mcl": "min_distance_m",
}
"""Variants that localise in a map of references, with the setting of the distance between these."""


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    return whole_and_resumed(tmp_path_factory.mktemp("words"), *MADE, "cache=null", ticks=10)


@pytest.fixture
def made(runs: tuple[Path, Path]) -> Path:
    return runs[0]


def test_killed_while_learning_it_goes_on_to_the_same_bytes(runs: tuple[Path, Path]) -> None:
    assert_same_bytes(*runs, "map.omap", "words.omap")


def test_a_saved_map_is_used_with_its_words(made: Path, tmp_path: Path) -> None:
    saved = (f"map={made / 'map.omap'}", f"words={made / 'words.omap'}", "nodes.source.stop=6")
    run = finished(tmp_path, "variant=omniview_mcl", *FOUND, *saved)
    assert (run / "words.omap").read_bytes() == (made / "words.omap").read_bytes()
    assert json.loads((run / "metrics.json").read_text())["frames"] == 6


@pytest.mark.parametrize("variant", DISTANCES)
def test_what_is_typed_for_a_map_is_of_its_words_too(variant: str) -> None:
    typed = f"{MAPPING}.{DISTANCES[variant]}=0.7"
    with composed([f"variant={variant}", "candidates=words", typed]) as config:
        made = {artifact.name: artifact.graph for artifact in prepare_run(complete(config)).artifacts}
    for name in ("map", "words"):
        graph = made[name]
        assert graph is not None
        assert getattr(graph.nodes["mapping"].stage, DISTANCES[variant]) == 0.7


def test_words_are_of_the_map_that_is_used(tmp_path: Path, shared_cache: Path) -> None:
    overrides = {
        "its own parameter": (f"{MAPPING}.distance_m=0.6",),
        "another stage's": ("artifacts.map.choices.mapping=image_database", f"{MAPPING}.min_distance_m=0.3"),
        "of part of the tour": ("tour_settings.cuts=[[10,20]]",),
    }
    sizes = set()
    for name, words in overrides.items():
        few = ("cuts=[[3,50]]", f"cache={shared_cache}")
        run = omninav.run("omniview_mcl", *FOUND, *few, *words, tour=TOUR, folder=tmp_path / name, progress=False)
        map, learned = (read_artifact(run.folder / f"{artifact}.omap") for artifact in ("map", "words"))
        assert isinstance(map, ReferenceGraph)
        assert isinstance(learned, VisualWords)
        assert len(learned) == len(map)
        sizes.add(len(map))
    assert len(sizes) == len(overrides)


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
