"""Results of repetitions are found again by what they are results of."""

import os
from pathlib import Path

import pytest

from omninav.pipeline.engine.cache import Cache
from omninav.pipeline.experiment.repetition import finished
from omninav.pipeline.experiment.runner import ExperimentRun
from omninav.pipeline.experiment.shared_inputs import is_recorded
from omninav.pipeline.files import digest_file, digest_text, locked, write_json, write_whole
from omninav.pipeline.graph.problems import BadInput


def kept(path: Path, key: str, seed: int) -> None:
    write_json(path, {"key": key, "seed": seed})


def test_a_condition_that_another_experiment_has_run_is_found_in_the_cache(tmp_path: Path):
    cache = Cache(tmp_path / "cache")
    kept(cache.path(digest_text("repetition", "a", "1"), ".json"), "a", 1)
    assert finished(tmp_path / "mine", "a", [0, 1], cache) == {1: {"key": "a", "seed": 1}}
    assert finished(tmp_path / "mine", "a", [0, 1]) == {}


def test_results_of_another_key_are_not_taken_for_this_one_s(tmp_path: Path):
    kept(tmp_path / "seed_0.json", "before the change", 0)
    assert finished(tmp_path, "after the change", [0]) == {}
    assert list(finished(tmp_path, "before the change", [0])) == [0]


def test_a_damaged_result_is_computed_again_and_this_is_said(tmp_path: Path, capfd: pytest.CaptureFixture[str]):
    kept(tmp_path / "seed_0.json", "a", 0)
    content = (tmp_path / "seed_0.json").read_text()
    for damaged in (content.replace('"seed": 0', '"seed": 1'), content[:20], "[]", ""):
        (tmp_path / "seed_0.json").write_text(damaged)
        assert finished(tmp_path, "a", [0]) == {}
    assert "it is taken from the cache, or runs again" in capfd.readouterr().err


def test_a_damaged_result_is_replaced_by_what_the_cache_has(tmp_path: Path, capfd: pytest.CaptureFixture[str]):
    cache, own = Cache(tmp_path / "cache"), tmp_path / "seed_0.json"
    kept(cache.path(digest_text("repetition", "a", "0"), ".json"), "a", 0)
    own.write_text('{"key": "a", "se')
    result = {0: {"key": "a", "seed": 0}}
    assert finished(tmp_path, "a", [0], cache) == result
    assert finished(tmp_path, "a", [0]) == result
    assert capfd.readouterr().err.count("taken from the cache") == 1


def test_a_recording_is_whole_or_made_again(tmp_path: Path, capfd: pytest.CaptureFixture[str]):
    folder = tmp_path / "drive"
    assert not is_recorded(folder, "a")
    write_whole(folder / "drive.mcap", b"frames")
    write_json(
        folder / "facts.json", {"key": "a", "facts": {}, "files": {"drive.mcap": digest_file(folder / "drive.mcap")}}
    )
    assert is_recorded(folder, "a")
    assert not is_recorded(folder, "another")
    write_whole(folder / "drive.mcap", b"framex")
    assert not is_recorded(folder, "a")
    assert "it is recorded again" in capfd.readouterr().err


def test_an_experiment_that_another_process_runs_is_refused(tmp_path: Path):
    run = ExperimentRun(None, "paper", "", tmp_path, [], [])  # type: ignore[arg-type]
    with locked(tmp_path / ".lock"), pytest.raises(BadInput, match=f"process {os.getpid()} is running it"):
        run.run()
