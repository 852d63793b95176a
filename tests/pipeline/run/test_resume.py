"""Going on with a run: what belongs to it, what has changed, what an older version made."""

from pathlib import Path
from typing import Any

import pytest
import yaml
from toy_runs import begun

from omninav.pipeline.engine.artifact import write_artifact
from omninav.pipeline.files import digest_text
from omninav.pipeline.graph.problems import BadInput, ProblemsFound
from omninav.pipeline.run.config_text import config_text
from omninav.pipeline.run.resume import complete_run, resume
from omninav.pipeline.run.run_folder import RunFolder
from toys import Number, graph_of_toys


@pytest.fixture(autouse=True)
def in_its_place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)  # a run goes on where it was started


def started(place: Path, **changes: Any) -> RunFolder:
    wires = {"reader": {"number": "source.number"}}
    config = graph_of_toys({"source": "Count", "reader": "Add"}, wires, variant="toy", runs=str(place))
    return begun(config | changes)


def rewrite(run: RunFolder, **nodes: str) -> None:
    """As if the run had been started with these stages."""
    config = yaml.safe_load((run.folder / "config.yaml").read_text())
    config["nodes"] |= {name: {"_target_": target} for name, target in nodes.items()}
    (run.folder / "config.yaml").write_text(yaml.safe_dump(config))
    run.manifest["config"] = digest_text(yaml.safe_dump(config))
    run.save()


def test_a_run_goes_on_with_the_text_of_its_configuration_as_it_stands(tmp_path: Path) -> None:
    run = started(tmp_path)
    rewrite(run)  # as older versions wrote it: each part in full, one value a line
    text = (run.folder / "config.yaml").read_text()
    assert text != config_text(yaml.safe_load(text))
    assert resume(run.folder)[0].folder == run.folder.resolve()
    assert (run.folder / "config.yaml").read_text() == text
    assert complete_run(run.folder)[1] == text


def test_a_run_of_an_older_version_says_how_to_start_it_again(tmp_path: Path) -> None:
    run = started(tmp_path)
    rewrite(run, reader="omninav.stages.matching.old.OldMatch")
    with pytest.raises(BadInput, match=r"made with an older omninav.*start it again: omninav variant=toy"):
        resume(run.folder)


def test_an_input_that_has_changed_or_gone_is_named(tmp_path: Path) -> None:
    file = tmp_path / "known.omap"
    write_artifact(file, Number(3.0))
    wires = {"reader": {"number": "source.number", "other": "artifacts.map"}}
    run = started(tmp_path / "runs", wires=wires, artifacts={"map": {"file": str(file)}})
    write_artifact(file, Number(4.0))
    with pytest.raises(BadInput, match="map changed since the run was started"):
        resume(run.folder)
    file.unlink()
    with pytest.raises(ProblemsFound, match="there is no such file"):
        resume(run.folder)
