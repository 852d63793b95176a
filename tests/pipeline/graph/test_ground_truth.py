"""A closed loop knows what a robot would know: what is refused, what is not, and what a user reads."""

import pytest

import toys
from omninav.pipeline.graph.builder import build
from omninav.pipeline.graph.ground_truth import steering, truth_readers
from omninav.pipeline.graph.problems import ProblemsFound
from omninav.pipeline.graph.signature import signature
from omninav.pipeline.report.mermaid import mermaid

NODES = {"source": "Steered", "stop": "Constant", "driving": "Scale", "scored": "Scale", "all": "Collected"}
WIRES = {
    "source": {"command": {"from": "driving.number", "delay": 1, "initial": "stop.number"}},
    "driving": {"number": "source.felt"},
    "scored": {"number": "source.truth"},
    "all": {"numbers": {"from": "source.truth", "collect": True}},
}


def config(nodes: dict, wires: dict) -> dict:
    return {"nodes": {name: {"_target_": f"toys.{kind}"} for name, kind in nodes.items()}, "wires": wires}


def refused(nodes: dict, wires: dict) -> list:
    with pytest.raises(ProblemsFound) as found:
        build(config(nodes, wires))
    return list(found.value.problems)


def test_metrics_behind_a_closed_loop_may_read_truth():
    graph = build(config(NODES, WIRES))
    assert steering(graph) == {"source", "driving", "stop"}
    assert truth_readers(graph) == ["all", "scored"]


def test_a_driver_that_reads_truth_is_refused_with_what_to_type():
    (problem,) = refused(NODES, WIRES | {"driving": {"number": "source.truth"}})
    assert problem.where == "wires.driving.number"
    said = "source.truth is ground truth, and 'driving' steers the source: nothing measures it in the field"
    assert problem.what == said
    assert problem.hint == "take the wire out: wires.driving.number=null"


def test_truth_is_found_where_it_comes_by_a_detour_or_by_another_name():
    detour = WIRES | {"driving": {"number": "scored.number"}}
    assert [problem.where for problem in refused(NODES, detour)] == ["wires.scored.number"]
    marked = WIRES | {"driving": {"number": "source.hidden"}}
    assert [problem.where for problem in refused(NODES, marked)] == ["wires.driving.number"]


def test_truth_is_found_on_delayed_wires_first_values_and_held_ones():
    delayed = {"number": {"from": "source.truth", "delay": 1, "initial": "stop.number"}}
    assert [problem.where for problem in refused(NODES, WIRES | {"driving": delayed})] == ["wires.driving.number"]
    first = {"number": {"from": "source.felt", "delay": 1, "initial": "source.truth"}}
    assert [problem.where for problem in refused(NODES, WIRES | {"driving": first})] == ["wires.driving.number"]
    held = {"number": {"from": "source.truth", "hold": True}}
    assert [problem.where for problem in refused(NODES, WIRES | {"driving": held})] == ["wires.driving.number"]


def test_a_command_cannot_be_truth_itself():
    told = WIRES | {"source": {"command": {"from": "source.truth", "delay": 1, "initial": "stop.number"}}}
    assert [problem.where for problem in refused(NODES, told)] == ["wires.source.command"]


def test_a_value_whose_type_is_truth_is_refused_wherever_it_comes_from():
    with_plan = {**NODES, "plan": "Surveyor"}
    assert [p.where for p in refused(with_plan, WIRES | {"driving": {"number": "plan.plan"}})] == [
        "wires.driving.number"
    ]
    assert build(config(with_plan, WIRES | {"scored": {"number": "plan.plan"}}))


def test_a_graph_without_a_loop_may_read_truth_everywhere():
    assert steering(build(config(NODES, {k: v for k, v in WIRES.items() if k != "source"}))) == frozenset()


def test_every_reader_of_marked_truth_is_marked_in_the_picture():
    drawn = mermaid(build(config(NODES, WIRES | {"scored": {"number": "source.hidden"}})))
    assert "class n_all,n_scored truth" in drawn
    assert signature(toys.Steered).outputs["hidden"].truth
    assert signature(toys.Steered).outputs["hidden"].type is toys.Number
    assert not signature(toys.Steered).outputs["felt"].truth
