"""The engine: lifetimes, delays, absence, logs in a row, and going on from a checkpoint."""

import math
import random
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from omninav.pipeline import Context, Tick
from omninav.pipeline.engine.cache import Cache
from omninav.pipeline.engine.call import VALIDATED_TICKS, StageFailed
from omninav.pipeline.engine.engine import Engine, EngineOptions
from omninav.pipeline.engine.prefix import cached_prefix, following, keep_prefix, prefix_nodes
from omninav.pipeline.graph.builder import build
from omninav.pipeline.graph.graph import Graph
from omninav.pipeline.graph.problems import BadInput
from toys import Big, Collected, Number, Remember, graph_of_toys


def graph_of(nodes: dict, wires: dict) -> Graph:
    return build(graph_of_toys(nodes, wires))


COLLECT = {"from": "sum.number", "collect": True}
SUM = {"source": "Count", "start": {"_target_": "Constant", "value": 5.0}, "sum": "Add", "all": "Collected"}
SUM_WIRES = {
    "sum": {"number": "source.number", "other": {"from": "sum.number", "delay": 1, "initial": "start.number"}},
    "all": {"numbers": COLLECT, "present": COLLECT},
}


def numbers(graph: Graph, tmp_path: Path, seed: int = 0) -> list:
    engine = Engine(graph, {}, EngineOptions(seed, tmp_path, tmp_path / "memory"), wanted=["all.metrics"])
    return engine.run()["all.metrics"].values["numbers"]["all"]


def test_a_delayed_wire_gives_the_initial_value_and_then_the_tick_before(tmp_path: Path):
    assert numbers(graph_of(SUM, SUM_WIRES), tmp_path) == [5, 6, 8, 11, 15, 20, 26, 33, 41, 50]


def test_a_delay_of_three_lags_three_ticks(tmp_path: Path):
    wires = {
        "sum": {"number": "start.number", "other": {"from": "source.number", "delay": 3, "initial": "start.number"}},
        "all": SUM_WIRES["all"],
    }
    assert numbers(graph_of(SUM, wires), tmp_path) == [10, 10, 10, 5, 6, 7, 8, 9, 10, 11]


def test_a_delayed_wire_whose_first_value_is_null_is_absent_at_the_first_tick(tmp_path: Path):
    wires = {**SUM_WIRES, "sum": {**SUM_WIRES["sum"], "other": {"from": "sum.number", "delay": 1, "initial": None}}}
    assert numbers(graph_of({k: v for k, v in SUM.items() if k != "start"}, wires), tmp_path)[:4] == [0, 1, 3, 6]


LEDGER = {"from": "enter.ledger", "delay": 1, "initial": "new.ledger"}


@pytest.mark.parametrize(("gap", "seen"), [(0, [*range(10)]), (3, [0, 1, 2, 2, 3, 4, 4, 5, 6, 6])])
def test_a_value_updated_in_place_is_seen_before_its_writer_and_kept_where_that_is_skipped(
    gap: int, seen: list, tmp_path: Path
):
    source = {"_target_": "Count", "gap": gap}
    nodes = {"source": source, "new": "NewLedger", "enter": "Enter", "look": "Look", "all": "Collected"}
    wires = {
        "enter": {"number": "source.number", "ledger": LEDGER},
        "look": {"ledger": LEDGER},
        "all": {"numbers": {"from": "look.number", "collect": True}},
    }
    assert numbers(graph_of(nodes, wires), tmp_path) == seen


def test_a_stage_that_lacks_a_required_input_is_skipped_and_counted(tmp_path: Path):
    graph = graph_of(
        {**SUM, "source": {"_target_": "Count", "gap": 3}, "sum": "Scale"},
        {"sum": {"number": "source.number"}, "all": SUM_WIRES["all"]},
    )
    engine = Engine(graph, {}, EngineOptions(0, tmp_path, tmp_path / "memory"), wanted=["all.metrics"])
    found = engine.run()["all.metrics"].values["numbers"]
    assert found == {"all": [0, 1, None, 3, 4, None, 6, 7, None, 9], "present": 7}
    assert engine.calls["sum"].ctx.counts["skipped.sum"] == 3
    assert [n for n, took in enumerate(engine.calls["sum"].times) if math.isnan(took)] == [2, 5, 8]


def test_hold_gives_the_last_present_value(tmp_path: Path):
    held = {"from": "source.number", "hold": True}
    graph = graph_of(
        {**SUM, "source": {"_target_": "Count", "gap": 3}}, {"sum": {"number": held}, "all": SUM_WIRES["all"]}
    )
    assert numbers(graph, tmp_path)[:6] == [None, 0, 1, 1, 3, 4]


def test_an_initial_value_that_comes_every_tick_replaces_the_delayed_one_when_it_is_present(tmp_path: Path):
    nodes = {**SUM, "source": {"_target_": "Count", "length_": 3, "logs": 2}, "start": "Restart"}
    wires = {**SUM_WIRES, "start": {"number": "source.number"}}
    # first log from 100, second from 101: 100+0, +1, +2, then 101+3, +4, +5
    assert numbers(graph_of(nodes, wires), tmp_path) == [100, 101, 103, 104, 108, 113]


def test_a_stage_knows_which_of_its_outputs_are_read_by_wires_first_values_and_whoever_wants_them():
    wires = {
        "source": {"command": {"from": "drive.number", "delay": 1, "initial": "stop.number"}},
        "drive": {"number": "source.felt"},
    }
    graph = graph_of({"source": "Steered", "drive": "Scale", "stop": "Constant"}, wires)
    engine = Engine(graph, wanted=["source.truth"])
    source, stop = engine.calls["source"].ctx, engine.calls["stop"].ctx
    assert [source.is_read(port) for port in ("felt", "truth", "hidden", "tick")] == [True, True, False, False]
    assert stop.is_read("number")
    assert Context("alone").is_read("anything")


def test_randomness_comes_from_seed_and_node_name_alone(tmp_path: Path):
    def noisy(extra: dict, seed: int, place: str) -> list:
        nodes = {"source": "Count", "sum": "Noise", "all": "Collected", **extra}
        wires = {
            "sum": {"number": "source.number"},
            "all": SUM_WIRES["all"],
            **{name: {"number": "source.number"} for name in extra},
        }
        return numbers(graph_of(nodes, wires), tmp_path / place, seed)

    assert noisy({}, 1, "a") == noisy({"another": "Noise"}, 1, "b")
    assert noisy({}, 1, "c") != noisy({}, 2, "d")


@pytest.mark.parametrize(
    ("early", "said"),
    [
        (False, r"at tick 3 \(log 0, frame 3\): RuntimeError: the wheel fell off"),
        (True, "in setup: RuntimeError: there is no wheel"),
    ],
)
def test_a_failing_stage_is_named_with_the_place(early: bool, said: str):
    nodes = {"source": "Count", "breaks": {"_target_": "Fail", "early": early}}
    engine = Engine(graph_of(nodes, {"breaks": {"number": "source.number"}}))
    with pytest.raises(StageFailed, match=rf"stage 'breaks' \(toys.Fail\) failed {said}"):
        engine.run()


def test_an_error_without_a_text_is_named_by_its_type():
    class Speechless(Exception):
        def __str__(self) -> str:
            raise ValueError

    def step(ctx: Context, number: Number) -> None:
        raise Speechless

    engine = Engine(graph_of({"source": "Count", "scale": "Scale"}, {"scale": {"number": "source.number"}}))
    engine.calls["scale"].step = step
    with pytest.raises(StageFailed, match=r"'scale' .*: Speechless, whose text cannot be had \(ValueError\)"):
        engine.run()


def test_a_source_whose_stamps_go_back_within_a_log_is_named_with_both(monkeypatch: pytest.MonkeyPatch):
    class Back(Tick):
        def __post_init__(self) -> None:
            object.__setattr__(self, "stamp", 100 - self.frame)

    graph = graph_of({"source": "Count", "scale": "Scale"}, {"scale": {"number": "source.number"}})
    monkeypatch.setattr("toys.Tick", Back)
    with pytest.raises(StageFailed, match=r"'source' \(.*Count\), tick 1: its stamp 99 ns is before .*, 100 ns"):
        Engine(graph).run()


def test_a_stage_that_exits_has_failed_and_does_not_end_the_program():
    engine = Engine(graph_of({"source": "Count", "scale": "Scale"}, {"scale": {"number": "source.number"}}))
    engine.calls["scale"].step = lambda ctx, number: sys.exit(0)
    with pytest.raises(StageFailed, match=r"stage 'scale' \(toys.Scale\) failed at tick 0 .*: SystemExit: 0"):
        engine.run()


def test_a_stage_that_gives_something_else_or_changes_what_others_read_too_is_named():
    engine = Engine(graph_of({"source": "Count", "scale": "Scale"}, {"scale": {"number": "source.number"}}))
    engine.calls["scale"].step = lambda ctx, number: {"number": number}
    said = r"stage 'scale' \(toys.Scale\) failed at tick 0 .*: step gave a value of type dict, expected its Out"
    with pytest.raises(StageFailed, match=said):
        engine.run()
    nodes = {"source": "Count", "scribble": {"_target_": "Scribble", "since": 3}}
    said = r"stage 'scribble' \(toys.Scribble\) failed at tick 3 .*: it changes its inputs"
    with pytest.raises(StageFailed, match=said):
        Engine(graph_of(nodes, {"scribble": {"big": "source.big"}})).run()
    nodes = {"source": "Count", "scribble": "Scribble"}
    graph = build(graph_of_toys(nodes, {"scribble": {"big": "artifacts.map"}}), {"map": Big})
    with pytest.raises(StageFailed, match=r"failed: it changes its inputs"):
        Engine(graph, artifacts={"map": Big(np.zeros(3))}).run()


def test_a_stage_that_writes_into_what_it_gave_before_is_named():
    graph = graph_of({"source": "Count", "reuse": "Reuse"}, {"reuse": {"number": "source.number"}})
    said = r"stage 'reuse' \(toys.Reuse\) failed at tick 1 .*: it changes what it gave before"
    with pytest.raises(StageFailed, match=said):
        Engine(graph).run()


def test_another_out_a_fact_that_is_no_json_and_what_cannot_be_kept_are_named_with_the_stage():
    def engine() -> Engine:
        return Engine(graph_of({"source": "Count", "scale": "Scale"}, {"scale": {"number": "source.number"}}))

    def fails(step: object, said: str) -> None:
        made = engine()
        made.calls["scale"].step = step
        with pytest.raises(StageFailed, match=rf"stage 'scale' \(toys.Scale\) failed at tick 0 .*: {said}"):
            made.run()

    out = graph_of({"source": "Count", "scale": "Scale"}, {"scale": {"number": "source.number"}}).nodes["scale"].stage
    fails(lambda ctx, number: Collected.Out(metrics=None), "step gave another Out than its own, without 'number'")
    fails(lambda ctx, number: ctx.fact("a", np.float32(3)), r"TypeError: ctx.fact\('a', …\): .*float32")
    fails(lambda ctx, number: ctx.warn(ValueError("a")), "TypeError: ctx.warn takes a sentence, not ValueError")
    fails(lambda ctx, number: ctx.count(3), "TypeError: ctx.count begins with a name")
    fails(lambda ctx, number: out.Out(number=Number({1, 2})), "builtins.set cannot be written")


@pytest.mark.parametrize("at", [0, 2])
def test_a_state_that_no_checkpoint_can_hold_is_named_with_its_field(tmp_path: Path, at: int):
    graph = graph_of({"source": "Count", "seen": "Remember"}, {"seen": {"number": "source.number"}})
    engine = Engine(graph, {}, EngineOptions(0, tmp_path, tmp_path / "memory"))

    def step(ctx: Context, number: Number, seen: Remember.Seen) -> None:
        seen.values = (number, open) if ctx.tick.index >= at else ()

    engine.calls["seen"].step = step
    with pytest.raises(
        StageFailed,
        match=r"stage 'seen' \(toys.Remember\): field 'values' of its State: builtins.*make all else in setup",
    ):
        engine.run()
    assert engine.ticks == (0 if at == 0 else 10)


FULL = {
    "source": {"_target_": "Count", "length_": 40, "gap": 7},
    "start": {"_target_": "Constant", "value": 5.0},
    "noise": "Noise",
    "breaks": {"_target_": "Fail", "at": -1},
    "seen": "Remember",
    "sum": "Add",
    "new": "NewLedger",
    "enter": "Enter",
    "look": "Look",
    "all": "Collected",
    "ledger": {"_target_": "Collected", "name": "ledger.txt"},
}
FULL_WIRES = {
    "noise": {"number": "source.number"},
    "breaks": {"number": "noise.number"},
    "seen": {"number": "breaks.number"},
    "sum": {
        "number": {"from": "seen.number", "hold": True},
        "other": {"from": "sum.number", "delay": 2, "initial": "start.number"},
    },
    "enter": {"number": "noise.number", "ledger": LEDGER},
    "look": {"ledger": LEDGER},
    "all": {"numbers": {"from": "sum.number", "collect": True}},
    "ledger": {"numbers": {"from": "noise.number", "collect": True}},
}


@pytest.mark.parametrize("at", [0, 1, 2, 14, 39])
def test_a_run_that_was_stopped_goes_on_to_the_same_result(tmp_path: Path, at: int):
    def run(place: Path, breaks_at: int) -> list:
        graph = graph_of({**FULL, "breaks": {"_target_": "Fail", "at": breaks_at}}, FULL_WIRES)
        engine = Engine(graph, {}, EngineOptions(3, place, place / "memory", "same", 0.0), wanted=["all.metrics"])
        values = engine.run()["all.metrics"].values
        return [values, *((place / f"{name}.txt").read_bytes() for name in ("numbers", "ledger"))]

    unbroken = run(tmp_path / "unbroken", -1)
    with pytest.raises(StageFailed):
        run(tmp_path / "broken", at)
    assert run(tmp_path / "broken", -1) == unbroken


def test_a_checkpoint_of_another_run_is_refused(tmp_path: Path):
    graph = graph_of(SUM, SUM_WIRES)
    Engine(graph, {}, EngineOptions(0, tmp_path, tmp_path / "memory", "one")).run()
    with pytest.raises(BadInput, match="belongs to another run"):
        Engine(graph, {}, EngineOptions(0, tmp_path, tmp_path / "memory", "other")).run()


DOUBLED = {"_target_": "Scale", "factor": 2.0}
PREFIX = {"source": "Count", "scale": DOUBLED, "start": "Constant", "sum": "Add", "all": "Collected"}
PREFIX_WIRES = {
    "scale": {"number": "source.number"},
    "sum": {"number": "scale.number", "other": {"from": "sum.number", "delay": 1, "initial": "start.number"}},
    "all": SUM_WIRES["all"],
}


def test_the_prefix_is_what_follows_from_the_log_alone_and_there_is_none_where_the_source_listens():
    assert prefix_nodes(graph_of(PREFIX, PREFIX_WIRES)) == {"source", "scale"}
    wires = {
        "source": {"command": {"from": "drive.number", "delay": 1, "initial": None}},
        "drive": {"number": "source.felt"},
    }
    assert prefix_nodes(graph_of({"source": "Steered", "drive": "Scale"}, wires)) == frozenset()


def cached_run(place: Path, cache: Cache, seed: int = 0, **nodes: object) -> tuple[list, bool]:
    """What a graph with a prefix gave, and whether the prefix was replayed."""
    graph, told = graph_of(PREFIX | nodes, PREFIX_WIRES), []
    with cached_prefix(graph, cache, seed) as prefix:
        options = EngineOptions(seed, place, place / "memory", on_tick=lambda *done: told.append(done))
        engine = Engine(graph, {}, options, wanted=["all.metrics"], replay=prefix.replay, recorded=prefix.recorded())
        values = engine.run()["all.metrics"].values["numbers"]["all"]
        keep_prefix(engine, prefix, cache)
        assert told == [(n, 10) for n in range(1, 11)]
        return values, prefix.replay is not None


def test_the_prefix_is_computed_once_and_then_replayed_with_the_same_result(tmp_path: Path):
    cache = Cache(tmp_path / "cache")
    first, second = cached_run(tmp_path / "a", cache), cached_run(tmp_path / "b", cache)
    assert first[0] == second[0]
    assert (first[1], second[1]) == (False, True)


def test_a_prefix_that_drew_is_replayed_for_its_seed_alone(tmp_path: Path):
    cache = Cache(tmp_path / "cache")
    found = [cached_run(tmp_path / str(n), cache, seed, scale="Noise") for n, seed in enumerate((0, 1, 0))]
    assert [replayed for _, replayed in found] == [False, False, True]
    assert found[0][0] == found[2][0] != found[1][0]


@pytest.mark.parametrize("draw", [np.random.rand, random.random])
def test_a_stage_that_draws_from_others_than_its_own_generator_is_named_and_kept_for_its_seed_alone(draw: Callable):
    graph = graph_of({"source": "Count", "scale": "Scale"}, {"scale": {"number": "source.number"}})
    call = Engine(graph).calls["scale"]
    call.step = lambda ctx, number: draw() and None
    call.run({"source.number": Number(1.0)})
    assert "stage 'scale' (toys.Scale) draws random numbers" in call.ctx.warnings[0]
    assert call.ctx.used_rng


def test_runs_that_differ_in_their_seed_share_what_follows_from_artifacts_but_not_from_draws():
    wires = PREFIX_WIRES | {"sum": {"number": "scale.number", "other": "artifacts.one"}}
    toys = graph_of_toys(PREFIX | {"start": "Noise"}, wires | {"start": {"number": "artifacts.one"}})
    graph = build(toys, {"one": Number})
    assert prefix_nodes(graph) == {"source", "scale"}
    assert prefix_nodes(graph, artifacts=True) == {"source", "scale", "sum"}
    assert prefix_nodes(graph, artifacts=True, without=["scale"]) == {"source"}
    assert prefix_nodes(graph, without=["source"]) == frozenset()
    assert following(graph, ["scale"]) == {"scale", "sum", "all"}


def test_a_damaged_prefix_is_computed_again(tmp_path: Path):
    cache = Cache(tmp_path / "cache")
    first, _ = cached_run(tmp_path / "a", cache)
    (kept,) = cache.folder.glob("*.prefix")
    kept.write_bytes(kept.read_bytes()[:-5])
    assert cached_run(tmp_path / "b", cache) == (first, False)


def test_a_prefix_may_hold_what_is_bulky_and_is_not_cached_where_that_leaves_it(tmp_path: Path):
    wires = {**PREFIX_WIRES, "enter": {"big": {"from": "source.big", "hold": True}}}
    with cached_prefix(graph_of({**PREFIX, "enter": "Swallow"}, wires), Cache(tmp_path), 0) as prefix:
        assert "enter" in prefix.nodes  # only its number leaves the prefix
        assert prefix.recorded()
    wires = {**PREFIX_WIRES, "enter": {"big": {"from": "source.big", "delay": 1, "initial": "source.big"}}}
    with cached_prefix(graph_of({**PREFIX, "enter": "Swallow"}, wires), Cache(tmp_path), 0) as prefix:
        assert prefix.reason == "not cached: source.big is too large to keep and is read by enter"
        assert not prefix.recorded()


@pytest.mark.parametrize("again", ["after its loop", "from a cached prefix"])
def test_a_result_that_is_given_every_tick_is_there_though_no_tick_runs_again(tmp_path: Path, again: str):
    graph = graph_of({"source": "Count", "latest": "Latest"}, {"latest": {"number": "source.number"}})
    cache, found = Cache(tmp_path / "cache"), []
    for place in (tmp_path / "first", tmp_path / ("first" if again == "after its loop" else "second")):
        with cached_prefix(graph, cache if again == "from a cached prefix" else None, 0) as prefix:
            options, recorded = EngineOptions(0, place, place / "memory"), prefix.recorded()
            engine = Engine(graph, {}, options, replay=prefix.replay, recorded=recorded)
            engine.run()
            keep_prefix(engine, prefix, cache)
        found.append(engine.last("latest.metrics").values)
    assert found == [{"latest": 9.0}, {"latest": 9.0}]


@pytest.mark.parametrize("since", [VALIDATED_TICKS - 1, VALIDATED_TICKS + 3])
def test_an_output_that_is_not_what_its_type_states_ends_the_run(since: int):
    nodes = {"source": {"_target_": "Count", "length_": 20}, "doubt": {"_target_": "Doubt", "since": since}}
    graph = graph_of(nodes, {"doubt": {"number": "source.number"}})
    said = (
        rf"stage 'doubt' \(toys.Doubt\) failed at tick {since} \(log 0, frame {since}\): its output 'certainty' is"
        r" not a valid Certainty: 'share' holds nan, expected finite numbers"
    )
    with pytest.raises(StageFailed, match=said):
        Engine(graph).run()


def test_an_optional_input_without_a_wire_is_none():
    graph = graph_of({"source": "Count", "sum": "Add"}, {"sum": {"number": "source.number"}})
    assert Engine(graph, wanted=("sum.number",)).run()["sum.number"].value == 9.0


def test_later_outputs_of_ours_are_checked_only_where_asked_for(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("omninav.pipeline.engine.call.BUILT_IN", "toys")
    nodes = {"source": {"_target_": "Count", "length_": 20}, "doubt": {"_target_": "Doubt", "since": VALIDATED_TICKS}}
    graph = graph_of(nodes, {"doubt": {"number": "source.number"}})
    engine = Engine(graph)
    engine.run()
    assert engine.ticks == 20
    with pytest.raises(StageFailed, match=f"failed at tick {VALIDATED_TICKS} "):
        Engine(graph, {}, EngineOptions(validate=True)).run()


def test_a_source_knows_who_reads_it_on_the_way_to_a_delayed_wire(tmp_path: Path):
    nodes = {**SUM, "aside": {"_target_": "Scale"}}
    graph = graph_of(nodes, {**SUM_WIRES, "aside": {"number": "source.number"}})
    engine = Engine(graph, {}, EngineOptions(0, tmp_path, tmp_path / "memory"))
    assert engine.calls["source"].ctx.readers == {"number": ["sum"]}
