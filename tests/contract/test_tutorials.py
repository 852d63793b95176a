"""The tutorials: every notebook runs from its first cell to its last, in an empty folder."""

import os
import sys
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

ROOT = Path(__file__).parents[2]
NOTEBOOKS = sorted(ROOT.glob("docs/tutorials/*.ipynb"))
EACH_DAY = ("my_log", "my_stage")
"""Notebooks that run by day; the others take minutes, and run at night."""
SHORTER = {
    r"tool(\"simulate\", ": r"tool(\"simulate\", \"world.timing.images=1\", ",
    "nodes.source.seconds=25": "nodes.source.seconds=8",
    "range(3)": "range(2)",
    "n_trials=5": "n_trials=2",
    "progress=False)": "rate=1, progress=False)",
    "(configuration, rate=1, ": "(configuration, ",
    r"robot.camera.yaml\", rate=1, ": r"robot.camera.yaml\", ",  # its estimates are compared with those at full rate
}
"""Seconds, numbers of runs, and drives at full rate that a reader is shown, and the smaller ones of a test."""


@pytest.mark.parametrize(
    "notebook",
    [
        pytest.param(file, id=file.stem, marks=() if file.stem in EACH_DAY else pytest.mark.nightly)
        for file in NOTEBOOKS
    ],
)
def test_a_notebook_runs_to_its_end(
    notebook: Path, tmp_path: Path, shared_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    monkeypatch.delenv("PYTHONSAFEPATH", raising=False)  # set by a command that another test ran in this process
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
    (tmp_path / "runs").mkdir()
    (tmp_path / "runs" / ".cache").symlink_to(shared_cache)
    shared_cache.mkdir(exist_ok=True)
    text = notebook.read_text()
    for of_a_reader, of_a_test in SHORTER.items():
        text = text.replace(of_a_reader, of_a_test)
    content = nbformat.reads(text, as_version=4)
    assert not [cell for cell in content.cells if cell.get("outputs")], "cells are committed without their outputs"
    NotebookClient(
        content, timeout=1800, kernel_name="python3", resources={"metadata": {"path": str(tmp_path)}}
    ).execute()
