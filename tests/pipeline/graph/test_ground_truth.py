"""A closed loop knows what a robot would know: what is refused, what is not, and what a user reads."""

import pytest

import toys
from omninav.pipeline.graph.builder import build
from omninav.pipeline.graph.ground_truth import steering, truth_readers
from omninav.pipeline.graph.problems import Problem, ProblemsFound
from omninav.pipeline.graph.signature import signature
from omninav.pipeline.report.mermaid import mermaid
from toys import graph_of_toys

NODES = {"source": "Steered", "stop": "Constant", "driving": "Scale", "scored": "Scale", "all": "Collected"}
WIRES = {
    "source": {"command": {"from": "driving.number", "delay": 1, "initial": "stop.number"}},
    "driving": {"number": "source.felt"},
    "scored": {"number": "source.truth"},
    "all": {"numbers": {"from": "source.truth", "collect": True}},
}


def refused_at(where: str, nodes: dict = NODES, **wires: object) -> Problem:
    """Gives the sentence on the one mistake of other nodes or wires."""
    with pytest.raises(ProblemsFound) as found:
        build(graph_of_toys(nodes, WIRES | wires))
    (problem,) = found.value.problems
    assert problem.where == where
    return problem


def test_metrics_behind_a_closed_loop_may_read_truth():
    graph = build(graph_of_toys(NODES, WIRES))
    assert steering(graph) == {"source", "driving", "stop"}
    assert truth_readers(graph) == ["all", "scored"]


def test_a_driver_that_reads_truth_is_refused_with_what_to_type_also_where_it_comes_by_a_detour():
    problem = refused_at("wires.driving.number", driving={"number": "source.truth"})
    said = "source.truth is ground truth, and 'driving' steers the source: nothing measures it in the field"
    assert (problem.what, problem.hint) == (said, "take the wire out: wires.driving.number=null")
    refused_at("wires.scored.number", driving={"number": "scored.number"})
    told = {"from": "source.truth", "delay": 1, "initial": "stop.number"}
    refused_at("wires.source.command", source={"command": told})


@pytest.mark.parametrize(
    "wire",
    [
        "source.hidden",
        {"from": "source.truth", "delay": 1, "initial": "stop.number"},
        {"from": "source.felt", "delay": 1, "initial": "source.truth"},
        {"from": "source.truth", "hold": True},
    ],
    ids=["marked", "delayed", "first value", "held"],
)
def test_truth_is_found_by_another_name_and_on_every_kind_of_wire(wire: object):
    refused_at("wires.driving.number", driving={"number": wire})


def test_a_value_whose_type_is_truth_is_refused_wherever_it_comes_from():
    with_plan = {**NODES, "plan": "Surveyor"}
    refused_at("wires.driving.number", with_plan, driving={"number": "plan.plan"})
    assert build(graph_of_toys(with_plan, WIRES | {"scored": {"number": "plan.plan"}}))


def test_a_graph_without_a_loop_may_read_truth_everywhere():
    assert steering(build(graph_of_toys(NODES, {k: v for k, v in WIRES.items() if k != "source"}))) == frozenset()


def test_every_reader_of_marked_truth_is_marked_in_the_picture():
    drawn = mermaid(build(graph_of_toys(NODES, WIRES | {"scored": {"number": "source.hidden"}})))
    assert "class n_all,n_scored truth" in drawn
    assert signature(toys.Steered).outputs["hidden"].truth
    assert signature(toys.Steered).outputs["hidden"].type is toys.Number
    assert not signature(toys.Steered).outputs["felt"].truth
