"""`kill -9` at any moment, then `omninav resume`: the same bytes as the unbroken run."""

import json
import random
import time
from pathlib import Path

import pytest
from background_runs import assert_same_bytes, finished, kill, start, wait_for_checkpoint, whole_and_resumed
from conftest import DATA, DRIVE, TOUR, needs_data

FILES = ("trajectory.tum", "metrics.json", "map.omap")
WORDS = (f"tour={TOUR}", f"log={DRIVE}", "+artifacts.map.nodes.source.stop=37", "nodes.source.stop=26")
"""The first halves of a tour and of a drive."""


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory, shared_cache: Path) -> Path:
    return finished(tmp_path_factory.mktemp("whole"), *WORDS, f"cache={shared_cache}")


@pytest.mark.parametrize("cached", [True, False])
def test_a_killed_run_resumes_to_the_same_bytes(whole: Path, tmp_path: Path, shared_cache: Path, cached: bool):
    """Kills in the map that is not cached and in the drive, again and again, until a resume comes through."""
    moments = random.Random(6)
    process = start(tmp_path, *WORDS, f"cache={shared_cache if cached else 'null'}", "checkpoint_s=0.05")
    runs = tmp_path / "runs"
    wait_for_checkpoint(process, tmp_path)
    kills = 0
    while process.poll() is None and kills < (1 if cached else 2):
        if kills:  # the first one is killed at once: a fast machine is soon done
            time.sleep(moments.uniform(0.0, 1.0))
        if process.poll() is None:
            kill(process)
            kills += 1
            (runs / "latest" / "result.mcap.1.part").write_bytes(b"half")  # as if killed while that file was written
            process = start(tmp_path, "resume", "runs/latest")
    assert kills > 0
    assert process.wait() == 0
    assert_same_bytes(runs / "latest", whole, *FILES)
    assert not (runs / "latest" / "checkpoints").exists()
    assert not list((runs / "latest").glob("*.part"))


@needs_data
def test_a_run_killed_while_views_wait_to_be_learned_or_may_be_taken_back_resumes_to_the_same_bytes(tmp_path: Path):
    """Each view waits for 4 m, some 18 images, and is corrected later: at any moment some views wait."""
    logs = f"log=[{DATA / 'photoreal-house' / 'tour.mcap'},{DATA / 'photoreal-house' / 'drive.mcap'}]"
    words = ("variant=particle_cml", logs, "nodes.source.stop=90", "cache=null")
    whole, resumed = whole_and_resumed(tmp_path / "run", *words, ticks=100)
    counted = json.loads((whole / "manifest.json").read_text())["dropped"]
    assert {"fixed_lag_smoother.view_propagated", "mapping.update_undone"} <= set(counted)
    assert_same_bytes(resumed, whole, *FILES, "trajectory_0.tum")
