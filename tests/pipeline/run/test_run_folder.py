"""A run's folder: there when all that a resume needs is in it, and never another run's."""

from pathlib import Path
from typing import Any

import pytest

from omninav.pipeline.graph.problems import BadInput
from omninav.pipeline.run import run_folder
from omninav.pipeline.run.plan import plan
from omninav.pipeline.run.resume import resume

CONFIG: dict[str, Any] = {
    "variant": "toy",
    "nodes": {"source": {"_target_": "toys.Count"}, "reader": {"_target_": "toys.Add"}},
    "wires": {"reader": {"number": "source.number"}},
}


def start(root: Path) -> Path:
    return run_folder.start(plan({**CONFIG, "runs": str(root)}), ["omninav"]).folder


def test_a_folder_that_can_be_seen_can_be_gone_on_with(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[list[str]] = []
    write = run_folder.write_whole

    def watched(path: Path, content: bytes | str) -> None:
        seen.append([folder.name for folder in tmp_path.iterdir() if not folder.name.startswith(".")])
        write(path, content)

    monkeypatch.setattr(run_folder, "write_whole", watched)
    folder = start(tmp_path)
    assert seen
    assert not any(seen)
    assert {"config.yaml", "manifest.json", "graph.svg", "graph.mmd"} <= {file.name for file in folder.iterdir()}
    assert (tmp_path / "latest").resolve() == folder.resolve()
    assert sorted(path.name for path in tmp_path.iterdir()) == [folder.name, "latest"]


def test_two_runs_that_start_in_one_second_have_folders_of_their_own(tmp_path: Path) -> None:
    folders = {start(tmp_path) for _ in range(5)}
    assert len(folders) == 5
    assert len({(folder / "manifest.json").stat().st_ino for folder in folders}) == 5


def test_what_is_no_run_folder_is_said(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="not a run folder"):
        resume(tmp_path)


def test_a_folder_in_place_of_the_link_to_the_latest_run_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "latest").mkdir()
    folder = start(tmp_path)
    said = capsys.readouterr().err
    assert said == f"{tmp_path / 'latest'} is a folder and no link, and does not lead to this run: {folder}\n"
