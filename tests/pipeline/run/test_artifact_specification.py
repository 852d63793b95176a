"""Where artifacts come from: files, other graphs, or nowhere; and what is wrong with a specification."""

from pathlib import Path
from typing import Any

import pytest

import toys
from omninav.pipeline.engine.artifact import artifact_digest, write_artifact
from omninav.pipeline.engine.codec import decode, encode, seal, unseal
from omninav.pipeline.files import digest_file, write_whole
from omninav.pipeline.graph.problems import ProblemsFound
from omninav.pipeline.run import artifacts
from omninav.pipeline.run.artifact_specification import read_specifications, without_plotted
from omninav.pipeline.run.execution import execute
from omninav.pipeline.run.plan import plan
from omninav.pipeline.run.run_folder import RunFolder, start


def configuration(port: str, file: Path | None) -> dict[str, Any]:
    return {
        "nodes": {"source": {"_target_": "toys.Count"}, "reader": {"_target_": "toys.Add"}},
        "wires": {"reader": {"number": "source.number", port: "artifacts.map"}},
        "artifacts": {"map": {"file": None if file is None else str(file), "required": False}},
    }


def test_without_a_file_the_port_stays_empty_and_with_one_it_is_wired(tmp_path: Path) -> None:
    planned = plan(configuration("other", None))
    assert [wire.to_port for wire in planned.graph.wires] == ["number"]
    assert planned.artifacts == ()
    file = tmp_path / "known.omap"
    write_artifact(file, toys.Number(3.0))
    planned = plan(configuration("other", file))
    assert {wire.to_port for wire in planned.graph.wires} == {"number", "other"}
    assert [artifact.name for artifact in planned.artifacts] == ["map"]


def test_a_port_that_needs_the_artifact_is_a_problem_without_it() -> None:
    config = configuration("other", None)
    config["wires"]["reader"] = {"number": "artifacts.map"}
    with pytest.raises(ProblemsFound) as found:
        plan(config)
    assert "wires.reader.number" in str(found.value)


def two_of_one_graph(tmp_path: Path) -> dict[str, Any]:
    graph = {
        "nodes": {
            "source": {"_target_": "toys.Count"},
            "twice": {"_target_": "toys.Scale"},
            "kept": {"_target_": "toys.Collected"},
            "also": {"_target_": "toys.Collected"},
        },
        "wires": {
            "twice": {"number": "source.number"},
            "kept": {"numbers": {"from": "source.number", "collect": True}},
            "also": {"numbers": {"from": "twice.number", "collect": True}},
        },
    }
    artifacts = {
        "map": {"variant": "toy", "graph": graph, "output": "twice.number"},
        "album": {
            "variant": "toy",
            "graph": graph,
            "output": "source.number",
            "required": False,
            "together_with": "map",
            "for_plots": True,
        },
    }
    return {
        "variant": "toys",
        "cache": str(tmp_path / "cache"),
        "runs": str(tmp_path / "runs"),
        "nodes": {"source": {"_target_": "toys.Count"}, "reader": {"_target_": "toys.Add"}},
        "wires": {"reader": {"number": "artifacts.map", "other": "artifacts.album"}},
        "artifacts": artifacts,
    }


def test_what_one_graph_gives_is_made_in_one_run_and_each_is_found_by_itself(tmp_path: Path) -> None:
    planned = plan(two_of_one_graph(tmp_path))
    made = start(planned, ["toys"])
    execute(made, planned)
    reasons = {name: entry["reason"] for name, entry in made.manifest["artifacts"].items()}
    assert reasons["map"].startswith("made")
    assert reasons["album"].startswith("found")
    assert len(list((tmp_path / "cache").rglob("*.omap"))) == 2
    alone = {**two_of_one_graph(tmp_path / "alone"), "wires": {"reader": {"number": "artifacts.map"}}}
    del alone["artifacts"]["album"]
    other = start(plan(alone), ["toys"])
    execute(other, plan(alone))
    assert other.manifest["artifacts"]["map"]["sha256"] == made.manifest["artifacts"]["map"]["sha256"]


@pytest.mark.parametrize("damage", ["a bit", "another's content", "an artifact that does not fit"])
def test_a_damaged_map_in_the_cache_is_made_again_and_is_the_same(
    tmp_path: Path, damage: str, capfd: pytest.CaptureFixture[str]
) -> None:
    planned = plan(two_of_one_graph(tmp_path))
    first, again = start(planned, ["toys"]), start(planned, ["toys"])
    execute(first, planned)
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
    execute(again, planned)
    assert again.manifest["artifacts"]["map"]["reason"].startswith("made")
    assert sum_of(again) == sum_of(first)
    assert capfd.readouterr().err.count("it is thrown away and made again") == 1
    assert cached.read_bytes() == content


def sum_of(run: RunFolder) -> str:
    return str(run.manifest["artifacts"]["map"]["sha256"])


def test_what_comes_with_a_map_is_not_there_where_the_map_is_from_a_file(tmp_path: Path) -> None:
    config = two_of_one_graph(tmp_path)
    write_artifact(tmp_path / "known.omap", toys.Number(3.0))
    config["artifacts"]["map"] = {"variant": "toy", "file": str(tmp_path / "known.omap"), "output": "twice.number"}
    assert [artifact.name for artifact in plan(config).artifacts] == ["map"]


def test_repetitions_do_without_what_comes_with_a_map(tmp_path: Path) -> None:
    config = without_plotted(two_of_one_graph(tmp_path))
    planned = plan(config)
    assert [artifact.name for artifact in planned.artifacts] == ["map"]
    assert [wire.to_port for wire in planned.graph.wires] == ["number"]
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
    config = {**configuration("other", None), "artifacts": {"map": spec}}
    with pytest.raises(ProblemsFound) as found:
        read_specifications(config)
    (problem,) = found.value.problems
    assert problem.where == where
    assert words in str(problem)


def test_a_block_of_artifacts_that_is_no_mapping_is_a_problem() -> None:
    with pytest.raises(ProblemsFound, match="expected a mapping from names"):
        read_specifications({"artifacts": ["map"]})


def test_an_artifact_that_is_neither_given_nor_made_says_what_to_give() -> None:
    config = configuration("other", None)
    config["artifacts"] = {"map": {"variant": "toy", "made_from": ["tour"]}}
    with pytest.raises(ProblemsFound) as found:
        plan(config)
    assert "this variant needs a map, and none is given" in str(found.value)
    assert "type tour=… to make one, or map=FILE.omap to load one" in str(found.value)


def test_what_an_artifact_is_made_from_given_in_its_place_says_what_to_type(tmp_path: Path) -> None:
    (tmp_path / "drive.mcap").write_bytes(b"\x89MCAP0\r\n")
    config = configuration("other", None)
    file = str(tmp_path / "drive.mcap")
    config["artifacts"] = {"map": {"variant": "toy", "made_from": ["tour"], "file": file}}
    with pytest.raises(ProblemsFound) as found:
        plan(config)
    assert f"if it is what a map is made from, type tour={file}" in str(found.value)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(ProblemsFound, match=r"nowhere\.omap: there is no such file"):
        plan(configuration("other", tmp_path / "nowhere.omap"))


def test_an_output_that_the_graph_does_not_have_names_the_nearest(tmp_path: Path) -> None:
    config = two_of_one_graph(tmp_path)
    config["artifacts"]["map"]["output"] = "twize.number"
    with pytest.raises(ProblemsFound) as found:
        plan(config)
    assert "artifacts.map.output: there is no output 'twize.number'" in str(found.value)
    assert "did you mean 'twice.number'?" in str(found.value)


def test_problems_of_the_graph_that_makes_it_are_at_its_own_path_unless_the_node_is_inherited(tmp_path: Path) -> None:
    for inherit, where in (([], "artifacts.map.nodes.twice.factor"), (["twice"], "nodes.twice.factor")):
        config = two_of_one_graph(tmp_path)
        config["nodes"]["twice"] = {"_target_": "toys.Scale"}
        config["wires"]["twice"] = {"number": "source.number"}
        config["artifacts"]["map"]["inherit"] = inherit
        config["artifacts"]["map"]["graph"]["nodes"]["twice"] = {"_target_": "toys.Scale", "factor": -1.0}
        del config["artifacts"]["album"], config["wires"]["reader"]["other"]
        with pytest.raises(ProblemsFound) as found:
            plan(config)
        assert [problem.where for problem in found.value.problems] == [where]


def test_a_large_file_of_an_artifact_is_linked_into_the_run_and_a_small_one_copied(tmp_path: Path, monkeypatch):
    file = tmp_path / "known.omap"
    write_artifact(file, toys.Number(3.0))
    for limit, linked in ((1 << 26, False), (0, True)):
        monkeypatch.setattr(artifacts, "IN_MEMORY", limit)
        planned = plan(configuration("other", file) | {"runs": str(tmp_path / "runs")})
        run = start(planned, ["toys"])
        execute(run, planned)
        assert (run.folder / "map.omap").samefile(file) is linked
        assert sum_of(run) == artifact_digest(file)
