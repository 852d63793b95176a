"""What a step took: of each stage, of all, and of some together; from times written down by hand."""

import math
from array import array

import pytest

from omninav.pipeline.engine.engine import Engine
from omninav.pipeline.graph.builder import build
from omninav.pipeline.run.timing import stage_times
from toys import graph_of_toys


@pytest.fixture
def engine() -> Engine:
    """Three stages in a row behind a source; times in milliseconds: one is slow where the other is quick."""
    nodes = {"source": "Count", "move": "Scale", "weigh": "Scale", "look": "Scale"}
    before = {"move": "source", "weigh": "move", "look": "weigh"}
    wires = {name: {"number": f"{origin}.number"} for name, origin in before.items()}
    engine = Engine(build(graph_of_toys(nodes, wires)))
    for name, took in {
        "source": [100.0] * 5,
        "move": [1.0, 9.0, 1.0, 9.0],
        "weigh": [9.0, 1.0, 9.0, math.nan],
        "look": [0.0, 0.0, 0.0, 50.0],
    }.items():
        engine.calls[name].times = array("d", [each / 1e3 for each in took])
    return engine


def test_what_stages_take_together_is_added_tick_by_tick_not_percentile_by_percentile(engine: Engine):
    found = stage_times(engine, [("move", "weigh")])["together"]["move+weigh"]
    assert found == pytest.approx({"p50_ms": 10.0, "p95_ms": 10.0, "max_ms": 10.0})
    stages = stage_times(engine)["stages"]
    assert stages["move"]["p95_ms"] + stages["weigh"]["p95_ms"] == pytest.approx(18.0)


def test_a_step_is_all_stages_but_the_source(engine: Engine):
    assert stage_times(engine)["step"]["max_ms"] == pytest.approx(59.0)
    assert stage_times(engine)["step"]["p50_ms"] == pytest.approx(10.0)


def test_a_stage_that_was_skipped_took_no_time_then_and_was_not_called(engine: Engine):
    stages = stage_times(engine)["stages"]
    assert (stages["weigh"]["calls"], stages["move"]["calls"]) == (3, 4)
    assert stages["weigh"]["p50_ms"] == pytest.approx(9.0)


def test_a_group_with_a_stage_that_never_ran_has_no_time(engine: Engine):
    engine.calls["look"].times = array("d", [math.nan] * 4)
    assert stage_times(engine, [("move", "look"), ("move", "sing")])["together"] == {}


def test_a_graph_that_has_run_has_times_for_every_tick(engine: Engine):
    for call in engine.calls.values():
        call.times = array("d")
    engine.run()
    found = stage_times(engine)
    assert found["stages"]["look"]["calls"] == found["ticks"] == 10
    assert found["step"]["max_ms"] >= found["stages"]["look"]["max_ms"]
