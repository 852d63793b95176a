"""An artifact that may be given or not: a map to continue, or none yet."""

from pathlib import Path
from typing import Any

import pytest

import toys
from omninav.pipeline.artifact import write_artifact
from omninav.pipeline.problems import ProblemsFound
from omninav.pipeline.run import plan


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
