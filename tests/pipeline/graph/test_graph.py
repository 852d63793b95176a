"""Graphs: what is accepted, and everything that is said about what is not."""

from types import SimpleNamespace

import pytest

import toys
from omninav.pipeline.graph.builder import build
from omninav.pipeline.graph.graph import Graph
from omninav.pipeline.graph.problems import BadInput, Problem, ProblemsFound
from omninav.pipeline.graph.pushed import push
from omninav.pipeline.graph.registry import entries
from toys import graph_of_toys


def built(nodes: dict, wires: dict | None = None) -> Graph:
    return build(graph_of_toys(nodes, wires))


def problems(nodes: dict, wires: dict | None = None, artifacts: dict | None = None) -> list[Problem]:
    with pytest.raises(ProblemsFound) as found:
        build(graph_of_toys(nodes, wires), artifacts)
    return list(found.value.problems)


def only(nodes: dict, wires: dict | None = None, artifacts: dict | None = None) -> Problem:
    found = problems(nodes, wires, artifacts)
    assert len(found) == 1, [str(problem) for problem in found]
    return found[0]


LOOP = {"source": "Count", "start": "Constant", "sum": "Add"}
LOOP_WIRES = {
    "sum": {"number": "source.number", "other": {"from": "sum.number", "delay": 1, "initial": "start.number"}}
}


def test_lifetimes_and_who_reads_a_port_follow_from_the_wires():
    wires = {
        **LOOP_WIRES,
        "scale": {"number": "start.number"},
        "all": {"numbers": {"from": "sum.number", "collect": True}},
        "look": {"number": "scale.number"},
    }
    graph = built({**LOOP, "scale": "Scale", "all": "Collected", "look": "Spell"}, wires)
    lifetimes = {"source": "tick", "sum": "tick", "all": "after"} | dict.fromkeys(("start", "scale", "look"), "before")
    assert {node.name: node.lifetime for node in graph.nodes.values()} == lifetimes
    assert [sorted(graph.readers_of(f"{node}.number")) for node in ("start", "source")] == [["scale", "sum"], ["sum"]]


def test_a_graph_knows_its_outputs_and_what_leads_to_them():
    artifacts = {"map": toys.Surveyed, "none": None}
    wires = LOOP_WIRES | {
        "all": {"numbers": {"from": "sum.number", "collect": True}},
        "scale": {"number": "sum.number"},
    }
    graph = build(graph_of_toys({**LOOP, "all": "Collected", "scale": "Scale"}, wires), artifacts)
    part = graph.leading_to(["sum.number", "artifacts.map"])
    assert (set(part.nodes), [wire.to_node for wire in part.wires]) == ({"source", "start", "sum"}, ["sum", "sum"])
    ports = [graph.port(origin) for origin in ("artifacts.map", "artifacts.none", "sum.no", "no.number", "sum.number")]
    assert [port and port.type for port in ports] == [toys.Surveyed, None, None, None, toys.Number]
    assert [graph.is_truth(o) for o in ("artifacts.map", "sum.number", "no.number")] == [True, False, False]
    assert [graph.is_marked(o, "bulky") for o in ("source.big", "source.number", "no.big")] == [True, False, False]
    assert graph.reported(graph.nodes) == {"all.metrics"}
    assert [node.name for node in graph.of_lifetime("tick")] == ["source", "sum", "scale"]


def test_all_problems_are_said_at_once():
    found = problems(
        {"source": "Count", "scale": {"_target_": "Scale", "facter": 2, "mode": "plane"}, "sum": "Add"},
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
    problem = only({"scale": {"_target_": "Scale", **value}, "c": "Constant"}, {"scale": {"number": "c.number"}})
    assert problem.what == said


SCALED = {"c": "Constant", "s": "Scale"}
SUMMED = {"source": "Count", "scale": "Scale", "sum": "Add"}
TOTALLED = {**LOOP, "total": "Total"}
TOTAL = {"numbers": {"from": "source.number", "collect": True}}
LEDGER = {"source": "Count", "new": "NewLedger", "look": "Look", "enter": "Enter"}
DELAYED = {"from": "enter.ledger", "delay": 1, "initial": "new.ledger"}
ENTER = {"number": "source.number", "ledger": DELAYED}
AGAIN = {"enter": ENTER, "look": {"ledger": "enter.ledger"}, "again": {"ledger": DELAYED}}


def delayed(origin: str, **more: object) -> dict:
    return {"from": f"{origin}.number", "delay": 1, **more}


WRONG: dict[str, tuple[dict, dict, list[str]]] = {
    "an unknown parameter": (
        {"scale": {"_target_": "Scale", "facter": 2}, "c": "Constant"},
        {"scale": {"number": "c.number"}},
        ["nodes.scale.facter: ", "did you mean 'nodes.scale.factor'?"],
    ),
    "another type": (
        {"c": "Constant", "spell": "Spell", "s": "Scale"},
        {"spell": {"number": "c.number"}, "s": {"number": "spell.word"}},
        [
            "wires.s.number: spell.word is of type Word, s.number (Scale) expects Number\n",
            "outputs of type Number: c.number, s.number",
        ],
    ),
    "a missing input": (
        {**SCALED, "d": "Constant"},
        {},
        ["Number on 'number'", "+wires.s.number=c.number (or d.number)"],
    ),
    "an unknown node": (
        {"start": "Constant", "s": "Scale"},
        {"s": {"number": "strat.number"}},
        ["did you mean 'start.number'?"],
    ),
    "an unknown node that an input can do without": (
        {"c": "Constant", "sum": "Add"},
        {"sum": {"number": "c.number", "other": "wheels.number"}},
        ["no node 'wheels'\n    type '~wires.sum.other' to leave this input out; outputs of type Number: c.number"],
    ),
    "an unknown node like one that is there, of which an input can do without": (
        {"start": "Constant", "sum": "Add"},
        {"sum": {"number": "start.number", "other": "strat.number"}},
        ["no node 'strat'\n    did you mean 'start.number'? outputs of type Number: start.number, sum.number"],
    ),
    "a needed wire from a node that was left out": (
        {"first": "Scale", "second": "Scale"},
        {"first": {"number": {"from": "nowhere.number", "optional": True}}, "second": {"number": "first.number"}},
        ["wires.second.number: "],
    ),
    "a needed wire to a node that is not there": (
        {"c": "Constant"},
        {"plot": {"number": {"from": "c.number", "optional": True}, "other": "c.number"}},
        ["wires.plot: "],
    ),
    "a delay without a first value": (
        LOOP,
        {"sum": {"number": "source.number", "other": delayed("sum")}},
        ["needs a first value", "type +wires.sum.other.initial=null, or node.port"],
    ),
    "a first value of null where one is needed": (
        SUMMED,
        {"scale": {"number": "source.number"}, "sum": {"number": delayed("scale", initial=None)}},
        [
            "wires.sum.number.initial: Add needs 'number' at every tick, and the first value is null\n",
            "outputs of type Number: scale.number, source.number, sum.number",
        ],
    ),
    "a loop without a delay": (
        {"a": "Add", "b": "Add", "c": "Constant"},
        {"a": {"number": "c.number", "other": "b.number"}, "b": {"number": "a.number"}},
        ["the nodes wait for each other: a -> b -> a", "delay: 1"],
    ),
    "one value for a sequence": (
        {"c": "Constant", "all": "Collected"},
        {"all": {"numbers": "c.number"}},
        ["write {from: …, collect: true}"],
    ),
    "a sequence for one value": (SCALED, {"s": {"number": {"from": "c.number", "collect": True}}}, ["takes one value"]),
    "a delay of what comes after the loop": (
        TOTALLED,
        {"sum": {"number": "source.number", "other": delayed("total", initial="start.number")}, "total": TOTAL},
        ["wires.sum.other: ", "'sum' runs after the loop"],
    ),
    "two sources": ({"a": "Count", "b": "Count"}, {}, ["several sources (a, b)"]),
    "a loop without a source": (
        {"c": "Constant", "sum": "Add"},
        {"sum": {"number": "c.number", "other": delayed("sum", initial=None)}},
        [": there is a loop but no source that makes ticks\n", "add a source: source=log"],
    ),
    "a sequence that is held": (
        {"source": "Count", "total": "Total"},
        {"total": {"numbers": {**TOTAL["numbers"], "hold": True}}},
        [": a collect wire has neither delay nor hold"],
    ),
    "a reader that cannot run before what updates in place": (
        {**LEDGER, "again": "Look", "both": "Enter"},
        {**AGAIN, "both": {"number": "look.number", "ledger": DELAYED}},
        ["must read Ledger before 'enter' updates it"],
    ),
    "two first values of what is updated in place": (
        {**LEDGER, "other": "NewLedger"},
        {"enter": ENTER, "look": {"ledger": {**DELAYED, "initial": "other.ledger"}}},
        [".ledger.initial: enter.ledger is one Ledger: all its delayed wires need the same initial value"],
    ),
    "what is updated in place, read from before the loop": (
        LEDGER,
        {"enter": {**ENTER, "ledger": "new.ledger"}, "look": {"ledger": "enter.ledger"}},
        [
            "wires.enter.ledger: 'enter' updates the Ledger of 'new', and a resumed run would not know how",
            "write wires.enter.ledger={from: enter.ledger, delay: 1, initial: new.ledger}",
        ],
    ),
    "what is updated in place, held": (
        LEDGER,
        {"enter": ENTER, "look": {"ledger": {"from": "enter.ledger", "hold": True}}},
        ["wires.look.ledger: ", "is updated in place"],
    ),
    "what is updated in place, delayed further": (
        LEDGER,
        {"enter": ENTER, "look": {"ledger": {**DELAYED, "delay": 2}}},
        ["wires.look.ledger: ", "is updated in place"],
    ),
    "what is updated in place, collected": (
        {**LEDGER, "look": "Ledgers"},
        {"enter": ENTER, "look": {"ledgers": {"from": "enter.ledger", "collect": True}}},
        ["wires.look.ledgers: ", "is updated in place"],
    ),
}
"""Nodes and wires with one thing that is wrong, and words of what is said: its place, what it is, and what to type."""


@pytest.mark.parametrize(("nodes", "wires", "said"), WRONG.values(), ids=WRONG)
def test_what_is_wrong_is_named_with_its_place_and_what_to_type(nodes: dict, wires: dict, said: list[str]):
    problem = str(only(nodes, wires))
    assert [words for words in said if words not in problem] == [], problem


def test_what_is_nearly_wrong_is_accepted():
    assert built({"c": "Constant"}, {"plot": {"number": {"from": "c.number", "optional": True}}}).wires == []
    other = delayed("scale", initial=None)
    built(SUMMED, {"scale": {"number": "source.number"}, "sum": {"number": "source.number", "other": other}})
    built(TOTALLED, {**LOOP_WIRES, "total": TOTAL})
    built({**LEDGER, "again": "Look"}, AGAIN)


def test_a_missing_artifact_is_a_problem_and_a_fitting_one_is_none():
    assert "there is no artifact 'map'" in only({"s": "Scale"}, {"s": {"number": "artifacts.map"}}).what
    build(graph_of_toys({"s": "Scale"}, {"s": {"number": "artifacts.map"}}), {"map": toys.Whole})
    assert "is of type Word" in only({"s": "Scale"}, {"s": {"number": "artifacts.map"}}, {"map": toys.Word}).what


def test_a_node_that_needs_an_optional_wire_from_nowhere_is_left_out_and_so_are_those_behind_it():
    nowhere = {"from": "measured.number", "optional": True}
    behind = {"number": {"from": "first.number", "optional": True}}
    nodes = {"c": "Constant", "first": "Scale", "second": "Scale", "sum": "Add"}
    wires = {"first": {"number": nowhere}, "second": behind, "sum": {"number": "c.number", "other": nowhere}}
    graph = built(nodes, wires)
    assert list(graph.nodes) == ["c", "sum"]
    assert [wire.where for wire in graph.wires] == ["wires.sum.number"]
    whole = built({**nodes, "measured": "Constant"}, wires)
    assert set(whole.nodes) == {*nodes, "measured"}
    assert len(whole.wires) == 4


def test_readers_of_a_value_updated_in_place_run_before_its_writer():
    wires = {"look": {"ledger": DELAYED}, "enter": {"number": "source.number", "ledger": DELAYED}}
    order = list(built({"enter": "Enter", **LEDGER}, wires).nodes)
    assert order.index("look") < order.index("enter")


def test_a_source_cannot_wait_for_what_is_collected():
    nodes = {"source": "Steered", "total": "Total"}
    command = {"from": "total.number", "delay": 1, "initial": None}
    wires = {"total": {"numbers": {"from": "source.felt", "collect": True}}, "source": {"command": command}}
    assert "a source cannot wait for what is collected until the end" in [p.what for p in problems(nodes, wires)]


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
        ({"from": "c.number", "delay": -1}, ".delay", "-1, expected a whole number"),
        ({"from": "c.number", "delay": True}, ".delay", "True, expected a whole number"),
        ("c.number.value", "", "'c.number.value' is not of the form node.port"),
        ({"from": "c.number", "hold": 1}, "", "hold and collect are true or false"),
        ({"from": "c.number", "initial": "c.number"}, "", "only a delayed wire has an initial value"),
        ("c.numbre", "", "node 'c' (Constant) has no output 'numbre'"),
    ],
)
def test_what_is_no_wire_says_why(wire: object, where: str, message: str):
    found = problems({"c": "Constant", "s": "Scale"}, {"s": {"number": wire}})
    assert any(p.where == f"wires.s.number{where}" and message in p.what for p in found), [str(p) for p in found]


@pytest.mark.parametrize(
    "target", ["toys.NotAStage", "os.system", "toys.Scale.step", "nowhere.Thing", "toys.Scael", "plain", "toys:Scael"]
)
def test_a_target_that_is_no_stage_is_refused_and_never_called(target: str):
    with pytest.raises(ProblemsFound) as found:
        build({"nodes": {"x": {"_target_": target}}, "wires": {}})
    assert [problem.where for problem in found.value.problems] == ["nodes.x._target_"]
    assert not toys.NotAStage.called


def test_a_target_that_is_nearly_a_stage_is_told_that_one():
    name = next(entry.target for entry in entries() if not entry.problem)
    with pytest.raises(ProblemsFound, match=f"did you mean '{name}'"):
        build({"nodes": {"x": {"_target_": f"{name}s"}}, "wires": {}})


def test_a_node_can_be_taken_out():
    assert list(build({"nodes": {"d": None, "c": {"_target_": "toys.Constant"}}, "wires": {}}).nodes) == ["c"]


def test_a_frame_is_pushed_whole_or_refused_with_what_the_source_takes():
    taken = []
    source = SimpleNamespace(push=lambda image, stamp=0: taken.append((image, stamp)))
    push(source, {"image": 1})
    push(source, {"image": 2, "stamp": 3})
    assert taken == [(1, 0), (2, 3)]
    for frame, said in (
        ({"imgae": 1}, "no imgae=…; did you mean 'image'"),
        ({}, "image=… is missing; it takes image, s"),
    ):
        with pytest.raises(BadInput, match=said):
            push(source, frame)


def test_a_stage_that_nothing_feeds_or_reads_is_said_to_have_no_place():
    lost, missing = problems({"caption": "Caption", "s": "Scale"})
    said = "nodes.caption: Caption has no place in this graph: nothing feeds it, and nothing reads it"
    assert (str(lost), missing.where) == (f"{said}\n    leave caption=… out", "wires.s.number")
    wired = problems({"source": "Count", "caption": "Caption"}, {"caption": {"big": "source.big"}})
    assert [problem.where for problem in wired] == ["wires.caption.word"]


def test_what_a_swap_leaves_over_says_what_to_type():
    nodes = {"c": "Constant", "s": "Spell", "all": "Collected", "sum": "Add"}
    wires = {"s": {"number": "c.number", "gain": "c.number"}, "sum": {"number": "c.word"}}
    left_over, missing = problems(nodes, wires)[:2]
    assert left_over.hint.endswith("to take the wire out, type '~wires.s.gain'")
    assert missing.hint.endswith("outputs of c: number; outputs of type Number: c.number, sum.number")


def test_where_no_output_fits_the_stages_that_give_one_are_named(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("OMNINAV_STAGES", "words.spell=toys:Spell")
    (problem,) = problems({"say": "Say", "c": "Constant"})
    assert problem.hint == "no output here is of type Word; stages that give it: words.spell"
