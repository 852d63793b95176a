"""Visual words are learned with a map and find its references."""

import json
from pathlib import Path

import pytest
from background_runs import assert_same_bytes, finished, killed_and_resumed
from conftest import DRIVE, TOUR

MADE = ("variant=omniview_mcl_map_words", f"log={TOUR}", "plots=none")
FOUND = (
    "variant=omniview_mcl",
    "candidates=words",
    f"log={DRIVE}",
    "nodes.candidates.compare_all_up_to=0",
    "plots=none",
)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory, shared_cache: Path) -> Path:
    return finished(tmp_path_factory.mktemp("words"), *MADE, f"cache={shared_cache}")


def test_killed_while_learning_it_goes_on_to_the_same_bytes(made: Path, tmp_path: Path, shared_cache: Path) -> None:
    run = killed_and_resumed(tmp_path, *MADE, "checkpoint_s=0.1", "cache=null", after_s=0.3)
    assert_same_bytes(run, made, "map.omap", "words.omap")


def test_a_saved_map_is_used_with_its_words(made: Path, tmp_path: Path) -> None:
    saved = (f"map={made / 'map.omap'}", f"words={made / 'words.omap'}", "nodes.source.stop=6")
    run = finished(tmp_path, *FOUND, *saved)
    assert (run / "words.omap").read_bytes() == (made / "words.omap").read_bytes()
    assert json.loads((run / "metrics.json").read_text())["frames"] == 6


def test_a_saved_map_without_its_words_is_refused_in_one_line(made: Path, omninav) -> None:
    ended = omninav("check", *FOUND, f"map={made / 'map.omap'}")
    assert ended.returncode == 2
    assert "words=FILE.omap to load one" in ended.stderr


def test_a_variant_whose_map_has_no_words_is_named(omninav) -> None:
    ended = omninav("check", "variant=particle_cml_baseline", "candidates=words")
    assert ended.returncode == 2
    assert (
        "artifacts.words.variant: there is no variant 'particle_cml_baseline_map_words' to make it with" in ended.stderr
    )
