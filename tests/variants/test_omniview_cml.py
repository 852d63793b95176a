"""Concurrent map building with mixtures of Gaussians: stopped anywhere, killed, and as a user runs it."""

import json
from pathlib import Path

import numpy as np
import pytest
from background_runs import assert_same_bytes, finished, whole_and_resumed
from conftest import DRIVE, TOUR

from omninav.pipeline.engine.artifact import read_artifact
from omninav.pipeline.engine.call import StageFailed
from omninav.pipeline.engine.codec import decode, encode
from omninav.pipeline.engine.engine import Engine, EngineOptions
from omninav.pipeline.graph.builder import build

STAGES = "omninav.stages"
NODES = {
    "source": {"_target_": "round_drive.Rounds"},
    "knows": {"_target_": "round_drive.Knows"},
    "empty": {"_target_": f"{STAGES}.mapping.initial_view_mixtures.InitialViewMixtures"},
    "map_update": {"_target_": f"{STAGES}.mapping.unimodal_queue.UnimodalQueue", "length": 12},
    "mapping": {"_target_": f"{STAGES}.mapping.adaptive_views.AdaptiveViews", "max_views": 20},
}
WIRES = {
    "knows": {"view": "source.view"},
    "map_update": {"view": "source.view", "state": "knows.belief", "model": "source.model"},
    "mapping": {
        "updates": "map_update.updates",
        "threshold": "source.threshold",
        "map": {"from": "mapping.map", "delay": 1, "initial": "empty.map"},
    },
}


def learned(place: Path, breaks_at: int = -1) -> bytes:
    graph = build({"nodes": {**NODES, "knows": {**NODES["knows"], "breaks_at": breaks_at}}, "wires": WIRES})
    engine = Engine(graph, {}, EngineOptions(0, place, place / "memory", "same", 0.0), wanted=["mapping.map"])
    return encode(engine.run()["mapping.map"])


def test_a_run_stopped_while_updates_wait_goes_on_to_the_same_map(tmp_path: Path):
    unbroken = learned(tmp_path / "unbroken")
    for at in (5, 18, 28, 35, 45):  # the queue fills, it is full, a way is open, it is worked out, flushed
        with pytest.raises(StageFailed):
            learned(tmp_path / str(at), at)
        assert learned(tmp_path / str(at)) == unbroken, at


FLUSH_PENDING = {"ticks": {"from": "source.tick", "collect": True}, "waiting": "map_update.waiting"}
LAST_MAP = {"updates": "flush_pending.updates", "threshold": "source.threshold", "map": "mapping.map"}


def test_what_waits_as_the_last_log_ends_is_learned_after_it(tmp_path: Path):
    flush_pending = {"_target_": f"{STAGES}.mapping.flush_pending.FlushPending"}
    nodes = NODES | {"flush_pending": flush_pending, "last_map": NODES["mapping"]}
    graph = build({"nodes": nodes, "wires": WIRES | {"flush_pending": FLUSH_PENDING, "last_map": LAST_MAP}})
    place = tmp_path / "after"
    engine = Engine(graph, {}, EngineOptions(0, place, place / "memory", "same", 0.0), wanted=["last_map.map"])
    last = engine.run()["last_map.map"]
    in_the_loop = decode(learned(tmp_path / "loop"))
    assert last.steps == in_the_loop.steps + 12


OPTIONS = ("nodes.source.stop=45", "nodes.novelty_threshold.views=40", "cache=null")
WORDS = ("variant=omniview_cml", f"log=[{TOUR},{DRIVE}]", *OPTIONS)


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    place = tmp_path_factory.mktemp("omniview_cml")
    return whole_and_resumed(place, *WORDS, ticks=60)  # the first log is over


@pytest.fixture
def whole(runs: tuple[Path, Path]) -> Path:
    return runs[0]


def test_a_killed_run_resumes_to_the_same_map_and_trajectory(runs: tuple[Path, Path]):
    assert_same_bytes(*runs, "map.omap", "trajectory.tum", "trajectory_0.tum", "metrics.json")


def test_a_saved_map_is_read_only_or_grows_on_and_forgetting_is_a_word(whole: Path, tmp_path: Path):
    def drive(name: str, *words: str) -> Path:
        return finished(tmp_path / name, WORDS[0], f"log={DRIVE}", *OPTIONS, f"map={whole / 'map.omap'}", *words)

    def threshold(run: Path):
        return json.loads((run / "manifest.json").read_text())["facts"]["novelty_threshold"]

    before, frozen = read_artifact(whole / "map.omap"), drive("frozen", "mapping=frozen")
    assert encode(read_artifact(frozen / "map.omap")) == encode(before)
    assert threshold(frozen) == threshold(whole) == round(before.threshold.distance, 4)
    run = drive("grown", "forgetting=passive", "nodes.straightened.max_distance=0")
    grown = read_artifact(run / "map.omap")
    assert grown.steps > before.steps
    assert np.isin(before.ids, grown.ids).mean() > 0.9
    assert "forgetting: passive" in (run / "config.yaml").read_text()
