"""Results of repetitions are found again by what they are results of."""

import json
from pathlib import Path

from omninav.pipeline.engine.cache import Cache
from omninav.pipeline.experiment.repetition import finished
from omninav.pipeline.files import digest_text, write_whole


def kept(path: Path, key: str, seed: int) -> None:
    write_whole(path, json.dumps({"key": key, "seed": seed}))


def test_a_condition_that_another_experiment_has_run_is_found_in_the_cache(tmp_path: Path):
    cache = Cache(tmp_path / "cache")
    kept(cache.path(digest_text("repetition", "a", "1"), ".json"), "a", 1)
    assert finished(tmp_path / "mine", "a", [0, 1], cache) == {1: {"key": "a", "seed": 1}}
    assert finished(tmp_path / "mine", "a", [0, 1]) == {}


def test_results_of_another_key_are_not_taken_for_this_one_s(tmp_path: Path):
    kept(tmp_path / "seed_0.json", "before the change", 0)
    assert finished(tmp_path, "after the change", [0]) == {}
    assert list(finished(tmp_path, "before the change", [0])) == [0]
