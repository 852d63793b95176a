"""An artifact that may be given or not: a map to continue, or none yet."""

from pathlib import Path
from typing import Any

import pytest

import toys
from omninav.pipeline.engine.artifact import write_artifact
from omninav.pipeline.graph.problems import ProblemsFound
from omninav.pipeline.run.run import execute, plan, start, without_companions


def configuration(port: str, file: Path | None) -> dict[str, Any]:
    return {
        "nodes": {"source": {"_target_": "toys.Count"}, "reader": {"_target_": "toys.Add"}},
        "wires": {"reader": {"number": "source.number", port: "artifacts.map"}},
        "artifacts": {"map": {"file": None if file is None else str(file), "optional": True}},
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
        "map": {"variant": "toy", "graph": graph, "from": "twice.number"},
        "album": {"variant": "toy", "graph": graph, "from": "source.number", "optional": True, "with": "map"},
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
    said = {name: entry["said"] for name, entry in made.manifest["artifacts"].items()}
    assert said["map"].startswith("made")
    assert said["album"].startswith("found")
    assert len(list((tmp_path / "cache").rglob("*.omap"))) == 2
    alone = {**two_of_one_graph(tmp_path / "alone"), "wires": {"reader": {"number": "artifacts.map"}}}
    del alone["artifacts"]["album"]
    other = start(plan(alone), ["toys"])
    execute(other, plan(alone))
    assert other.manifest["artifacts"]["map"]["sha256"] == made.manifest["artifacts"]["map"]["sha256"]


def test_what_comes_with_a_map_is_not_there_where_the_map_is_from_a_file(tmp_path: Path) -> None:
    config = two_of_one_graph(tmp_path)
    write_artifact(tmp_path / "known.omap", toys.Number(3.0))
    config["artifacts"]["map"] = {"variant": "toy", "file": str(tmp_path / "known.omap"), "from": "twice.number"}
    assert [artifact.name for artifact in plan(config).artifacts] == ["map"]


def test_repetitions_do_without_what_comes_with_a_map(tmp_path: Path) -> None:
    config = without_companions(two_of_one_graph(tmp_path))
    planned = plan(config)
    assert [artifact.name for artifact in planned.artifacts] == ["map"]
    assert [wire.to_port for wire in planned.graph.wires] == ["number"]
    assert without_companions(config) is config
