"""A run's folder: there when all that a resume needs is in it, and never another run's."""

import os
from pathlib import Path

import pytest
from toy_runs import begun, ended, noisy_sum

from omninav.pipeline.run import run_folder
from toys import Noise


def start(root: Path) -> Path:
    return begun(noisy_sum(root)).folder


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


def test_a_folder_in_place_of_the_link_to_the_latest_run_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "latest").mkdir()
    folder = start(tmp_path)
    said = capsys.readouterr().err
    assert said == f"{tmp_path / 'latest'} is a folder and no link, and does not lead to this run: {folder}\n"


def test_a_stage_that_changes_the_working_folder_changes_it_for_its_run_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(Noise, "setup", lambda self, ctx: os.chdir("/"))
    assert (ended(noisy_sum(Path("runs"))).folder / "report.html").is_file()
    assert Path.cwd() == tmp_path
