"""Graphs: what is accepted, and everything that is said about what is not."""

import pytest

import toys
from omninav.pipeline.graph.builder import build
from omninav.pipeline.graph.problems import ProblemsFound


def config(nodes: dict, wires: dict | None = None) -> dict:
    return {
        "nodes": {
            name: {"_target_": f"toys.{spec}"} if isinstance(spec, str) else spec for name, spec in nodes.items()
        },
        "wires": wires or {},
    }


def problems(nodes: dict, wires: dict | None = None, artifacts: dict | None = None) -> list:
    with pytest.raises(ProblemsFound) as found:
        build(config(nodes, wires), artifacts)
    return list(found.value.problems)


def only(nodes: dict, wires: dict | None = None, artifacts: dict | None = None):
    found = problems(nodes, wires, artifacts)
    assert len(found) == 1, [str(problem) for problem in found]
    return found[0]


LOOP = {"source": "Count", "start": "Constant", "sum": "Add"}
LOOP_WIRES = {
    "sum": {"number": "source.number", "other": {"from": "sum.number", "delay": 1, "initial": "start.number"}}
}


def test_lifetimes_follow_from_the_wires():
    graph = build(
        config(
            {**LOOP, "scale": "Scale", "all": "Collected", "look": "Spell"},
            {
                **LOOP_WIRES,
                "scale": {"number": "start.number"},
                "all": {"numbers": {"from": "sum.number", "collect": True}},
                "look": {"number": "scale.number"},
            },
        )
    )
    assert {n.name: n.lifetime for n in graph.nodes.values()} == {
        "source": "tick",
        "start": "before",
        "sum": "tick",
        "scale": "before",
        "all": "after",
        "look": "before",
    }


def test_who_reads_a_port_can_be_asked():
    assert build(config(LOOP, LOOP_WIRES)).readers_of("start.number") == ["sum"]
    assert build(config(LOOP, LOOP_WIRES)).readers_of("source.number") == ["sum"]


def test_all_problems_are_said_at_once():
    found = problems(
        {"source": "Count", "scale": {"_target_": "toys.Scale", "facter": 2, "mode": "plane"}, "sum": "Add"},
        {"sum": {"number": "sorce.number", "othr": "scale.number"}, "scal": {"number": "source.number"}},
    )
    assert [problem.where for problem in found] == [
        "nodes.scale.facter",
        "nodes.scale.mode",
        "wires.sum.number",
        "wires.sum.othr",
        "wires.scal",
        "wires.scale.number",
    ]


def test_an_unknown_parameter_names_the_nearest_one():
    problem = only(
        {"scale": {"_target_": "toys.Scale", "facter": 2}, "c": "Constant"}, {"scale": {"number": "c.number"}}
    )
    assert problem.where == "nodes.scale.facter"
    assert "did you mean 'nodes.scale.factor'?" in problem.hint


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ({"factor": "two"}, "'two' (str), expected float > 0 and <= 100"),
        ({"factor": -1}, "-1.0 is out of bounds, expected float > 0 and <= 100"),
        ({"factor": True}, "True (bool), expected float > 0 and <= 100"),
        ({"mode": "plane"}, "'plane' (str), expected 'plain' | 'negative'"),
        ({"weights": [1, "x"]}, "'x' (str), expected float"),
    ],
)
def test_a_wrong_parameter_names_what_was_expected(value: dict, said: str):
    problem = only({"scale": {"_target_": "toys.Scale", **value}, "c": "Constant"}, {"scale": {"number": "c.number"}})
    assert problem.what == said


def test_wrong_types_on_a_wire_show_both_sides_and_what_would_fit():
    problem = only(
        {"c": "Constant", "spell": "Spell", "s": "Scale"},
        {"spell": {"number": "c.number"}, "s": {"number": "spell.word"}},
    )
    assert problem.where == "wires.s.number"
    assert problem.what == "spell.word is of type Word, s.number (Scale) expects Number"
    assert problem.hint == "outputs of type Number: c.number, s.number"


def test_a_missing_input_names_what_would_fit():
    problem = only({"c": "Constant", "s": "Scale"})
    assert (problem.where, problem.hint) == ("wires.s.number", "type +wires.s.number=c.number")


def test_an_unknown_node_on_a_wire_names_the_nearest_one():
    problem = only({"start": "Constant", "s": "Scale"}, {"s": {"number": "strat.number"}})
    assert "did you mean 'start.number'?" in problem.hint


def test_a_missing_artifact_is_a_problem_and_a_fitting_one_is_none():
    assert "there is no artifact 'map'" in only({"s": "Scale"}, {"s": {"number": "artifacts.map"}}).what
    build(config({"s": "Scale"}, {"s": {"number": "artifacts.map"}}), {"map": toys.Whole})
    assert "is of type Word" in only({"s": "Scale"}, {"s": {"number": "artifacts.map"}}, {"map": toys.Word}).what


def test_a_node_that_needs_an_optional_wire_from_nowhere_is_left_out_and_so_are_those_behind_it():
    nowhere = {"from": "measured.number", "optional": True}
    behind = {"number": {"from": "first.number", "optional": True}}
    nodes = {"c": "Constant", "first": "Scale", "second": "Scale", "sum": "Add"}
    wires = {"first": {"number": nowhere}, "second": behind, "sum": {"number": "c.number", "other": nowhere}}
    graph = build(config(nodes, wires))
    assert list(graph.nodes) == ["c", "sum"]
    assert [wire.where for wire in graph.wires] == ["wires.sum.number"]
    whole = build(config({**nodes, "measured": "Constant"}, wires))
    assert set(whole.nodes) == {*nodes, "measured"}
    assert len(whole.wires) == 4


def test_a_needed_wire_from_a_node_that_was_left_out_is_a_problem():
    wires = {"first": {"number": {"from": "nowhere.number", "optional": True}}, "second": {"number": "first.number"}}
    assert only({"first": "Scale", "second": "Scale"}, wires).where == "wires.second.number"


def test_optional_wires_may_feed_a_node_that_is_not_there():
    wire = {"from": "c.number", "optional": True}
    assert not build(config({"c": "Constant"}, {"plot": {"number": wire}})).wires
    assert only({"c": "Constant"}, {"plot": {"number": wire, "other": "c.number"}}).where == "wires.plot"


def test_a_delay_without_a_first_value_is_a_problem():
    problem = only(LOOP, {"sum": {"number": "source.number", "other": {"from": "sum.number", "delay": 1}}})
    assert "needs a first value" in problem.what
    assert problem.hint == "type +wires.sum.other.initial=null, or node.port"


def test_a_first_value_of_null_is_for_optional_ports():
    delayed = {"from": "scale.number", "delay": 1, "initial": None}
    nodes = {"source": "Count", "scale": "Scale", "sum": "Add"}
    scale = {"number": "source.number"}
    build(config(nodes, {"scale": scale, "sum": {"number": "source.number", "other": delayed}}))
    problem = only(nodes, {"scale": scale, "sum": {"number": delayed}})
    assert (problem.where, problem.what) == (
        "wires.sum.number.initial",
        "Add needs 'number' at every tick, and the first value is null",
    )
    assert problem.hint == "outputs of type Number: scale.number, source.number, sum.number"


def test_a_loop_without_a_delay_shows_the_way_round():
    problem = only(
        {"a": "Add", "b": "Add", "c": "Constant"},
        {"a": {"number": "c.number", "other": "b.number"}, "b": {"number": "a.number"}},
    )
    assert "the nodes wait for each other: a -> b -> a" in problem.what
    assert "delay: 1" in problem.hint


def test_a_sequence_port_needs_a_collect_wire_and_the_other_way_round():
    problem = only({"c": "Constant", "all": "Collected"}, {"all": {"numbers": "c.number"}})
    assert problem.hint == "write {from: …, collect: true}"
    problem = only({"c": "Constant", "s": "Scale"}, {"s": {"number": {"from": "c.number", "collect": True}}})
    assert "takes one value" in problem.what


def test_nothing_after_the_loop_can_feed_the_loop_by_a_delay():
    nodes = {**LOOP, "total": "Total"}
    total = {"numbers": {"from": "source.number", "collect": True}}
    build(config(nodes, {**LOOP_WIRES, "total": total}))
    late = {"number": "source.number", "other": {"from": "total.number", "delay": 1, "initial": "start.number"}}
    problem = only(nodes, {"sum": late, "total": total})
    assert problem.where == "wires.sum.other"
    assert "'sum' runs after the loop" in problem.what


def test_two_sources_are_one_too_many():
    assert "several sources (a, b)" in only({"a": "Count", "b": "Count"}).what


LEDGER = {"source": "Count", "new": "NewLedger", "look": "Look", "enter": "Enter"}
DELAYED = {"from": "enter.ledger", "delay": 1, "initial": "new.ledger"}


def test_readers_of_a_value_updated_in_place_run_before_its_writer():
    wires = {"look": {"ledger": DELAYED}, "enter": {"number": "source.number", "ledger": DELAYED}}
    order = list(build(config({"enter": "Enter", **LEDGER}, wires)).nodes)
    assert order.index("look") < order.index("enter")


def test_a_reader_that_cannot_run_before_the_writer_is_refused():
    nodes = {**LEDGER, "again": "Look"}
    wires = {
        "enter": {"number": "source.number", "ledger": DELAYED},
        "look": {"ledger": "enter.ledger"},
        "again": {"ledger": DELAYED},
    }
    build(config(nodes, wires))
    nodes["both"] = "Enter"
    wires["both"] = {"number": "look.number", "ledger": DELAYED}
    assert "must read Ledger before 'enter' updates it" in only(nodes, wires).what


@pytest.mark.parametrize(
    ("reader", "port", "wire"),
    [
        ("Look", "ledger", {"hold": True}),
        ("Look", "ledger", {"delay": 2, "initial": "new.ledger"}),
        ("Ledgers", "ledgers", {"collect": True}),
    ],
    ids=["hold", "delay", "collect"],
)
def test_a_value_updated_in_place_cannot_be_held_collected_or_delayed_further(reader: str, port: str, wire: dict):
    enter = {"number": "source.number", "ledger": DELAYED}
    problem = only({**LEDGER, "look": reader}, {"enter": enter, "look": {port: {"from": "enter.ledger", **wire}}})
    assert problem.where == f"wires.look.{port}"
    assert "is updated in place" in problem.what


def test_a_source_cannot_wait_for_what_is_collected():
    nodes = {"source": "Steered", "total": "Total"}
    command = {"from": "total.number", "delay": 1, "initial": None}
    wires = {"total": {"numbers": {"from": "source.felt", "collect": True}}, "source": {"command": command}}
    assert "a source cannot wait for what is collected until the end" in [p.what for p in problems(nodes, wires)]


def test_all_delayed_wires_of_a_value_updated_in_place_begin_with_the_same_one():
    other = {**DELAYED, "initial": "other.ledger"}
    wires = {"enter": {"number": "source.number", "ledger": DELAYED}, "look": {"ledger": other}}
    problem = only({**LEDGER, "other": "NewLedger"}, wires)
    assert problem.where.endswith(".ledger.initial")
    assert "all its delayed wires need the same initial value" in problem.what


@pytest.mark.parametrize(
    ("graph", "where", "message"),
    [
        ({"nodes": ["c"]}, "nodes", "expected a mapping from names to stages"),
        ({"nodes": {"artifacts": {"_target_": "toys.Count"}}}, "nodes.artifacts", "cannot be the name of a node"),
        ({"nodes": {"c": {"value": 1}}}, "nodes.c", "a node needs `_target_`"),
        ({"nodes": {"p": {"_target_": "toys.Picky", "low": 2.0}}}, "nodes.p", "low is above high"),
        ({"nodes": {"t": {"_target_": "toys.Tickless"}}}, "nodes.t", "a source needs an output `tick: Tick`"),
        ({"wires": ["s"]}, "wires", "expected a mapping: node -> port -> where it comes from"),
        ({"wires": {"s": "c.number"}}, "wires.s", "expected a mapping from ports to where they come from"),
    ],
)
def test_what_is_no_graph_says_what_was_expected(graph: dict, where: str, message: str):
    with pytest.raises(ProblemsFound) as found:
        build({"nodes": {"s": {"_target_": "toys.Count"}}} | graph)
    assert any(p.where == where and message in p.what for p in found.value.problems), str(found.value)


@pytest.mark.parametrize(
    ("wire", "where", "message"),
    [
        (3, "", "3 is no wire"),
        ({"delay": 1}, "", "is no wire"),
        ("number", "", "'number' is not of the form node.port"),
        ({"from": "c.number", "hodl": True}, ".hodl", "a wire has no such option"),
        ({"from": "c.number", "delay": "one"}, ".delay", "'one', expected a whole number of ticks >= 0"),
        ({"from": "c.number", "hold": 1}, "", "hold and collect are true or false"),
        ({"from": "c.number", "initial": "c.number"}, "", "only a delayed wire has an initial value"),
        ("c.numbre", "", "node 'c' (Constant) has no output 'numbre'"),
    ],
)
def test_what_is_no_wire_says_why(wire: object, where: str, message: str):
    found = problems({"c": "Constant", "s": "Scale"}, {"s": {"number": wire}})
    assert any(p.where == f"wires.s.number{where}" and message in p.what for p in found), [str(p) for p in found]


def test_a_collected_sequence_is_neither_delayed_nor_held():
    collected = {"numbers": {"from": "source.number", "collect": True, "hold": True}}
    problem = only({"source": "Count", "total": "Total"}, {"total": collected})
    assert problem.what == "a collect wire has neither delay nor hold"


def test_a_loop_needs_a_source():
    wires = {"sum": {"number": "c.number", "other": {"from": "sum.number", "delay": 1, "initial": None}}}
    problem = only({"c": "Constant", "sum": "Add"}, wires)
    assert (problem.what, problem.hint) == (
        "there is a loop but no source that makes ticks",
        "add a source: source=log",
    )


def test_a_target_that_is_no_stage_is_refused_and_never_called():
    for target in (
        "toys.NotAStage",
        "os.system",
        "toys.Scale.step",
        "nowhere.Thing",
        "toys.Scael",
        "plain",
        "toys:Scael",
    ):
        problem = only({"x": {"_target_": target}})
        assert problem.where == "nodes.x._target_"
    assert not toys.NotAStage.called


def test_a_node_can_be_taken_out():
    assert list(
        build(config({"c": "Constant"}) | {"nodes": {"c": {"_target_": "toys.Constant"}, "d": None}}).nodes
    ) == ["c"]


def test_what_a_swap_leaves_over_says_what_to_type():
    nodes, wires = (
        {"c": "Constant", "s": "Spell", "all": "Collected"},
        {"s": {"number": "c.number", "gain": "c.number"}},
    )
    left_over, missing = problems({**nodes, "sum": "Add"}, {**wires, "sum": {"number": "c.word"}})[:2]
    assert left_over.hint.endswith("to take the wire out, type '~wires.s.gain'")
    assert missing.hint.endswith("outputs of c: number; outputs of type Number: c.number, sum.number")


def test_where_no_output_fits_the_stages_that_give_one_are_named(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("OMNINAV_STAGES", "words.spell=toys:Spell")
    (problem,) = problems({"say": "Say", "c": "Constant"})
    assert problem.hint == "no output here is of type Word; stages that give it: words.spell"
