"""Where artifacts come from: files, other graphs, or nowhere; and what is wrong with a specification."""

from pathlib import Path
from typing import Any

import pytest
from toy_runs import ended

import toys
from omninav.pipeline.engine.artifact import artifact_digest, write_artifact
from omninav.pipeline.engine.codec import decode, encode, seal, unseal
from omninav.pipeline.files import digest_file, write_whole
from omninav.pipeline.graph.problems import ProblemsFound
from omninav.pipeline.run import artifacts
from omninav.pipeline.run.artifact_specification import read_specifications, without_plotted
from omninav.pipeline.run.execution import _dropped_before
from omninav.pipeline.run.prepared_run import prepare_run
from omninav.pipeline.run.run_folder import RunFolder
from toys import graph_of_toys

NODES = {"source": "Count", "reader": "Add"}


def configuration(**map: object) -> dict[str, Any]:
    """A graph that reads a map where one is there."""
    wires = {"reader": {"number": "source.number", "other": "artifacts.map"}}
    return graph_of_toys(NODES, wires, artifacts={"map": map})


def of_file(file: Path | None) -> dict[str, Any]:
    return configuration(file=None if file is None else str(file), required=False)


@pytest.mark.parametrize(("inputs", "stop", "told"), [("same", 0, 1), ("same", 3, 0), ("other", 0, 0)])
def test_an_artifact_of_the_input_that_is_run_is_told(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, inputs: str, stop: int, told: int
) -> None:
    monkeypatch.setattr(toys.Count, "inputs_digest", lambda self: inputs if self.logs > 1 else "same")
    config = two_of_one_graph(tmp_path)
    config["nodes"]["source"] |= {"gap": stop}
    config["artifacts"]["map"] |= {"made_from": ["tour"]}
    if inputs == "other":
        config["nodes"]["source"] |= {"logs": 2}
    warnings = ended(config).manifest["warnings"]
    sentence = "map: it is made from the input of this run, so figures are too good; give another tour=…"
    assert warnings == [sentence] * told


def test_a_source_that_gives_no_tick_is_told(tmp_path: Path) -> None:
    graph = graph_of_toys({"source": "Count"}, {}, variant="toy", runs=str(tmp_path))
    graph["nodes"]["source"] |= {"length_": 0}
    assert ended(graph).manifest["warnings"] == ["source gave no tick, so nothing has run in the loop"]


@pytest.fixture
def known(tmp_path: Path) -> Path:
    write_artifact(tmp_path / "known.omap", toys.Number(3.0))
    return tmp_path / "known.omap"


def test_without_a_file_the_port_stays_empty_and_with_one_it_is_wired(known: Path) -> None:
    prepared = prepare_run(of_file(None))
    assert [wire.to_port for wire in prepared.graph.wires] == ["number"]
    assert prepared.artifacts == ()
    prepared = prepare_run(of_file(known))
    assert {wire.to_port for wire in prepared.graph.wires} == {"number", "other"}
    assert [artifact.name for artifact in prepared.artifacts] == ["map"]


def two_of_one_graph(tmp_path: Path) -> dict[str, Any]:
    kept, also = ({"numbers": {"from": f"{node}.number", "collect": True}} for node in ("source", "twice"))
    wires = {"twice": {"number": "source.number"}, "kept": kept, "also": also}
    graph = graph_of_toys({"source": "Count", "twice": "Scale", "kept": "Collected", "also": "Collected"}, wires)
    made = {"variant": "toy", "graph": graph}
    together = {"required": False, "together_with": "map", "for_plots": True}
    artifacts = {"map": {**made, "output": "twice.number"}, "album": {**made, "output": "source.number", **together}}
    folders = {name: str(tmp_path / name) for name in ("cache", "runs")}
    wires = {"reader": {"number": "artifacts.map", "other": "artifacts.album"}}
    return graph_of_toys(NODES, wires, variant="toys", artifacts=artifacts, **folders)


def test_what_one_graph_gives_is_made_in_one_run_and_each_is_found_by_itself(tmp_path: Path) -> None:
    made = ended(two_of_one_graph(tmp_path))
    reasons = {name: entry["reason"] for name, entry in made.manifest["artifacts"].items()}
    assert reasons["map"].startswith("made")
    assert reasons["album"].startswith("found")
    assert len(list((tmp_path / "cache").rglob("*.omap"))) == 2
    alone = {**two_of_one_graph(tmp_path / "alone"), "wires": {"reader": {"number": "artifacts.map"}}}
    del alone["artifacts"]["album"]
    assert sum_of(ended(alone)) == sum_of(made)
    alone["artifacts"]["map"]["variant"] = "another"
    alone["cache"] = str(tmp_path / "cache")
    found = ended(alone).manifest["artifacts"]["map"]
    assert found["variant"] == "another"
    assert found["reason"] == "found: made before by toy, the same graph over the same log"


@pytest.mark.parametrize("damage", ["a bit", "another's content", "an artifact that does not fit"])
def test_a_damaged_map_in_the_cache_is_made_again_and_is_the_same(
    tmp_path: Path, damage: str, capfd: pytest.CaptureFixture[str]
) -> None:
    first = ended(two_of_one_graph(tmp_path))
    cached = next(file for file in (tmp_path / "cache").glob("*.omap") if artifact_digest(file) == sum_of(first))
    content = cached.read_bytes()
    if damage == "a bit":
        cached.write_bytes(content[:70] + bytes([content[70] ^ 1]) + content[71:])
    else:
        write_artifact(cached, toys.Number(7.0))
    if damage == "an artifact that does not fit":
        write_whole(cached, cached.read_bytes()[:-5])
        entry = cached.with_suffix(".omap.entry")
        stated = decode(unseal(entry.read_bytes(), "entry")) | {"sha256": digest_file(cached)}
        write_whole(entry, seal(encode(stated)))
    again = ended(two_of_one_graph(tmp_path))
    assert again.manifest["artifacts"]["map"]["reason"].startswith("made")
    assert sum_of(again) == sum_of(first)
    assert capfd.readouterr().err.count("it is thrown away and made again") == 1
    assert cached.read_bytes() == content


def sum_of(run: RunFolder) -> str:
    return str(run.manifest["artifacts"]["map"]["sha256"])


def test_what_comes_with_a_map_is_not_there_where_the_map_is_from_a_file(tmp_path: Path, known: Path) -> None:
    config = two_of_one_graph(tmp_path)
    config["artifacts"]["map"] = {"variant": "toy", "file": str(known), "output": "twice.number"}
    assert [artifact.name for artifact in prepare_run(config).artifacts] == ["map"]


def test_repetitions_do_without_what_comes_with_a_map(tmp_path: Path) -> None:
    config = without_plotted(two_of_one_graph(tmp_path))
    prepared = prepare_run(config)
    assert [artifact.name for artifact in prepared.artifacts] == ["map"]
    assert [wire.to_port for wire in prepared.graph.wires] == ["number"]
    assert without_plotted(config) is config


@pytest.mark.parametrize(
    ("spec", "where", "words"),
    [
        ({"choises": {}}, "artifacts.map.choises", "did you mean 'artifacts.map.choices'?"),
        ({"required": "no"}, "artifacts.map.required", "'no' (str), expected bool"),
        ({"inherit": ["sauce"]}, "artifacts.map.inherit", "did you mean 'source'?"),
        ({"must_match": ["raeder"]}, "artifacts.map.must_match", "did you mean 'reader'?"),
        ({"together_with": "mop"}, "artifacts.map.together_with", "there is no artifact 'mop'"),
        ("known.omap", "artifacts.map", "expected a mapping"),
    ],
)
def test_a_specification_that_is_wrong_says_where_and_what_is_near(spec: Any, where: str, words: str) -> None:
    with pytest.raises(ProblemsFound) as found:
        read_specifications(configuration() | {"artifacts": {"map": spec}})
    (problem,) = found.value.problems
    assert problem.where == where
    assert words in str(problem)


def said_of(config: dict[str, Any]) -> str:
    with pytest.raises(ProblemsFound) as found:
        prepare_run(config)
    return str(found.value)


def test_what_an_artifact_lacks_is_named_with_what_to_type(tmp_path: Path) -> None:
    log, other_output = tmp_path / "drive.mcap", two_of_one_graph(tmp_path)
    log.write_bytes(b"\x89MCAP0\r\n")
    other_output["artifacts"]["map"]["output"] = "twize.number"
    tour = {"variant": "toy", "made_from": ["tour"]}
    for config, *words in (
        ({"artifacts": ["map"]}, "expected a mapping from names"),
        (of_file(None) | {"wires": {"reader": {"number": "artifacts.map"}}}, "wires.reader.number"),
        (configuration(**tour), "this variant needs a map, and none is given", "type tour=… to make one, or map=FILE"),
        (configuration(**tour, file=str(log)), f"if it is what a map is made from, type tour={log}"),
        (of_file(tmp_path / "nowhere.omap"), "nowhere.omap: there is no such file"),
        (other_output, "artifacts.map.output: there is no output 'twize.number'", "did you mean 'twice.number'?"),
    ):
        said = said_of(config)
        assert [each for each in words if each not in said] == [], said


@pytest.mark.parametrize("readers", [1, 2, 3])
def test_a_file_that_several_inputs_cannot_take_is_one_problem(tmp_path: Path, readers: int) -> None:
    write_artifact(tmp_path / "word.omap", toys.Word("far"))
    nodes = {f"reader{number}": "Scale" for number in range(readers)}
    graph = graph_of_toys({"source": "Count", **nodes}, {name: {"number": "artifacts.map"} for name in nodes})
    said = said_of(of_file(tmp_path / "word.omap") | graph)
    assert said.startswith("1 problem:")
    one, several = (
        "wires.reader0.number: artifacts.map is of type Word",
        "word.omap holds Word, which {} inputs of this",
    )
    assert (one if readers == 1 else several.format(readers)) in said


def test_what_was_dropped_as_maps_were_made_is_told_once() -> None:
    blank, dark, other = ({kind: {"count": n, "first": ""}} for kind, n in (("blank", 2), ("dark", 2), ("blank", 3)))
    entries = {"map": blank, "album": blank | dark, "other": other, "none": None}
    made = {name: {"dropped": dropped} for name, dropped in entries.items()} | {"known": {"file": "", "dropped": other}}
    assert list(_dropped_before(made)) == ["blank (map)", "dark (album)", "blank (other)"]


@pytest.mark.parametrize(
    ("inherit", "where"), [([], "artifacts.map.nodes.twice.factor"), (["twice"], "nodes.twice.factor")]
)
def test_problems_of_the_graph_that_makes_it_are_at_its_own_path_unless_the_node_is_inherited(
    tmp_path: Path, inherit: list[str], where: str
) -> None:
    config = two_of_one_graph(tmp_path)
    config["nodes"]["twice"] = {"_target_": "toys.Scale"}
    config["wires"] = {"twice": {"number": "source.number"}, "reader": {"number": "artifacts.map"}}
    del config["artifacts"]["album"]
    config["artifacts"]["map"]["inherit"] = inherit
    config["artifacts"]["map"]["graph"]["nodes"]["twice"]["factor"] = -1.0
    with pytest.raises(ProblemsFound) as found:
        prepare_run(config)
    assert [problem.where for problem in found.value.problems] == [where]


@pytest.mark.parametrize(("limit", "linked"), [(1 << 26, False), (0, True)])
def test_a_large_file_of_an_artifact_is_linked_into_the_run_and_a_small_one_copied(
    tmp_path: Path, known: Path, monkeypatch: pytest.MonkeyPatch, limit: int, linked: bool
) -> None:
    monkeypatch.setattr(artifacts, "IN_MEMORY", limit)
    run = ended(of_file(known) | {"runs": str(tmp_path / "runs")})
    assert (run.folder / "map.omap").samefile(known) is linked
    assert sum_of(run) == artifact_digest(known)
