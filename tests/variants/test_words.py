"""Visual words are learned with a map and find its references."""

import json
from pathlib import Path

import pytest
from background_runs import assert_same_bytes, finished, killed_and_resumed
from conftest import DRIVE, GRID, TOUR

import omninav
from omninav.pipeline.engine.artifact import read_artifact
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.visual_words import VisualWords

FOUND = ("candidates=words", f"log={DRIVE}", "nodes.candidates.compare_all_up_to=0", "plots=none")
MADE = ("variant=omniview_mcl", *FOUND, f"tour={TOUR}", "nodes.source.stop=12")
LOCALISERS = {
    "omninav": "nodes.mapping.distance_m=0.6",
    "omniview_mcl": "nodes.mapping.distance_m=0.6",
    "omniview_mcl_as_printed": "nodes.mapping.distance_m=0.6",
    "plain_matching": "nodes.mapping.distance_m=0.6",
    "retrieval_mcl": "nodes.mapping.min_distance_m=0.6",
}
"""What localises in a map of references, and how the map of each is made with more or fewer references."""


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory, shared_cache: Path) -> Path:
    return finished(tmp_path_factory.mktemp("words"), *MADE, f"cache={shared_cache}")


def test_killed_while_learning_it_goes_on_to_the_same_bytes(made: Path, tmp_path: Path) -> None:
    run = killed_and_resumed(tmp_path, *MADE, "checkpoint_s=0.1", "cache=null", ticks=10)
    assert_same_bytes(run, made, "map.omap", "words.omap")


def test_a_saved_map_is_used_with_its_words(made: Path, tmp_path: Path) -> None:
    saved = (f"map={made / 'map.omap'}", f"words={made / 'words.omap'}", "nodes.source.stop=6")
    run = finished(tmp_path, "variant=omniview_mcl", *FOUND, *saved)
    assert (run / "words.omap").read_bytes() == (made / "words.omap").read_bytes()
    assert json.loads((run / "metrics.json").read_text())["frames"] == 6


@pytest.mark.parametrize("variant", LOCALISERS)
def test_words_are_of_the_map_that_is_used(variant: str, tmp_path: Path, shared_cache: Path) -> None:
    overrides = {"its own parameter": (f"+artifacts.map.{LOCALISERS[variant]}",)}
    if variant == "omniview_mcl":
        overrides |= {
            "another stage's": (
                "artifacts.map.choices.mapping=image_database",
                "+artifacts.map.nodes.mapping.min_distance_m=0.3",
            ),
            "of part of the tour": ("tour_settings.cuts=[[10,20]]",),
        }
    settings = {"tour": TOUR, "grid": GRID} if variant == "retrieval_mcl" else {"tour": TOUR}
    sizes = set()
    for name, words in overrides.items():
        landmarks = ["landmarks=none"] if variant == "omninav" else []  # the others have none
        few = ("cuts=[[3,50]]", *landmarks, f"cache={shared_cache}")
        run = omninav.run(variant, *FOUND, *few, *words, folder=tmp_path / name, progress=False, **settings)
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
