"""Concurrent map building with mixtures of Gaussians: stopped anywhere, killed, and as a user runs it."""

import json
from pathlib import Path

import numpy as np
import pytest
from background_runs import assert_same_bytes, finished, whole_and_resumed
from conftest import DATA, DRIVE, TOUR, needs_data

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


@pytest.mark.parametrize(
    ("at", "what"),
    [(5, "the queue fills"), (18, "it is full"), (28, "a way is open"), (35, "the way is worked out"), (45, "flushed")],
)
def test_a_run_stopped_while_updates_wait_goes_on_to_the_same_map(tmp_path: Path, at: int, what: str):
    unbroken = learned(tmp_path / "unbroken")
    with pytest.raises(StageFailed):
        learned(tmp_path / "broken", at)
    assert learned(tmp_path / "broken") == unbroken, what


FLUSH_PENDING = {"ticks": {"from": "source.tick", "collect": True}, "waiting": "map_update.waiting"}
LAST_MAP = {"updates": "flush_pending.updates", "threshold": "source.threshold", "map": "mapping.map"}


def test_what_waits_as_the_last_log_ends_is_learned_after_it(tmp_path: Path):
    flush_pending = {"_target_": f"{STAGES}.mapping.flush_pending.FlushPending"}
    graph = build(
        {
            "nodes": {**NODES, "flush_pending": flush_pending, "last_map": NODES["mapping"]},
            "wires": {**WIRES, "flush_pending": FLUSH_PENDING, "last_map": LAST_MAP},
        }
    )
    place = tmp_path / "after"
    engine = Engine(graph, {}, EngineOptions(0, place, place / "memory", "same", 0.0), wanted=["last_map.map"])
    last = engine.run()["last_map.map"]
    in_the_loop = decode(learned(tmp_path / "loop"))
    assert last.steps == in_the_loop.steps + 12


HOUSE = DATA / "photoreal-house"
OPTIONS = ("nodes.source.stop=45", "nodes.novelty_threshold.views=40", "cache=null")
WORDS = ("variant=omniview_cml", f"log=[{TOUR},{DRIVE}]", *OPTIONS)


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    place = tmp_path_factory.mktemp("omniview_cml")
    return whole_and_resumed(place, *WORDS, ticks=60)  # the first log is over


@pytest.fixture
def whole(runs: tuple[Path, Path]) -> Path:
    return runs[0]


@needs_data
def test_two_logs_of_a_house_grow_one_map_and_the_second_finds_itself_in_it(tmp_path: Path):
    logs = f"log=[{HOUSE / 'tour.mcap'},{HOUSE / 'drive.mcap'}]"
    whole = finished(tmp_path, "variant=omniview_cml", logs, *OPTIONS)
    metrics = json.loads((whole / "metrics.json").read_text())
    assert [log["frames"] for log in metrics["logs"]] == [45, 45]
    assert metrics["position_error_m"]["median"] < 1.0
    assert metrics["heading_error_deg"]["median"] < 8.0
    assert (whole / "trajectory_0.tum").exists()
    assert (whole / "trajectory.tum").read_bytes() == (whole / "trajectory_1.tum").read_bytes()


def test_a_killed_run_resumes_to_the_same_map_and_trajectory(runs: tuple[Path, Path]):
    assert_same_bytes(*runs, "map.omap", "trajectory.tum", "trajectory_0.tum", "metrics.json")


def test_a_saved_map_is_read_only_or_grows_on_and_forgetting_is_a_word(whole: Path, tmp_path: Path):
    def drive(name: str, *words: str) -> Path:
        return finished(tmp_path / name, WORDS[0], f"log={DRIVE}", *OPTIONS, f"map={whole / 'map.omap'}", *words)

    def content(run: Path):
        return read_artifact(run / "map.omap")

    before = content(whole)

    def threshold(run: Path):
        return json.loads((run / "manifest.json").read_text())["facts"]["novelty_threshold"]

    frozen = drive("frozen", "mapping=frozen")
    assert encode(content(frozen)) == encode(before)
    assert threshold(frozen) == threshold(whole) == round(before.threshold.distance, 4)
    grown = content(drive("grown", "forgetting=passive", "nodes.straightened.max_distance=0"))
    assert grown.steps > before.steps
    assert np.isin(before.ids, grown.ids).mean() > 0.9
    config = (tmp_path / "grown" / "runs" / "latest" / "config.yaml").read_text()
    assert "forgetting: passive" in config
