"""Names in files: none leads out of its folder, none is a program for a terminal, and each is of its type."""

import io
import sys
from pathlib import Path

import pytest
import yaml
from rich.table import Table
from small_run import reference_graph

from omninav.pipeline import BadInput
from omninav.pipeline.cli.main import main
from omninav.pipeline.cli.terminal import show
from omninav.pipeline.engine.artifact import artifact_bytes
from omninav.pipeline.experiment.specification import read_experiment
from omninav.pipeline.graph.problems import ProblemsFound
from omninav.pipeline.report.progress import Progress
from omninav.pipeline.report.terminal_text import cleaned, plain
from omninav.stages.recordings.opening import open_recording

ESCAPE = "\x1b]0;owned\x07\x1b[2J\x9b1m\r"


EXPERIMENT = {
    "name": "mine",
    "title": "T",
    "about": "A",
    "variant": "omniview_mcl",
    "set": "start=truth",
    "sweep": {"match": {"a": "match=selective", "b": "match=l2"}},
    "measures": {"error": {"title": "E", "path": ["position_error_m.median"], "digits": 2}},
    "page": {"rows": [], "columns": "match"},
}


@pytest.mark.parametrize("name", ["/tmp/absolute", "a" * 300, "a\0b", "a b", "", "a.b", "ä", "\x1b[2J"])
def test_an_experiments_name_is_a_name(name: str):
    assert read_experiment(EXPERIMENT, "full").name == "mine"
    with pytest.raises(ProblemsFound) as refused:
        read_experiment({**EXPERIMENT, "name": name}, "full")
    assert [problem.where for problem in refused.value.problems] == ["experiment.name"]


@pytest.mark.parametrize("command", [[], ["check"]])
def test_an_experiment_whose_name_leads_out_of_its_folder_is_refused_by_each_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], command: list[str]
):
    monkeypatch.chdir(tmp_path)
    Path("my/experiment").mkdir(parents=True)
    described = {"defaults": ["test_worlds", "_self_"], **EXPERIMENT, "name": "../../above"}
    Path("my/experiment/mine.yaml").write_text("# @package experiment\n" + yaml.safe_dump(described, sort_keys=False))
    assert main([*command, "--config-dir=my", "+experiment=mine"]) == 2
    said = capsys.readouterr().err
    assert "experiment.name" in said
    assert "Traceback" not in said


LAYOUT = "frames: {csv: images.csv, file: filename, images: '%s', time: {column: t, unit: s}}\n"
CAMERA = "camera: {projection: cylindrical, column_of_forward: 80, sense: clockwise}\n"


@pytest.mark.parametrize(
    ("images", "name"),
    [("", "../above.jpg"), ("", "/etc/passwd"), ("..", "above.jpg"), ("/..", "above.jpg"), ("", "a/../../above.jpg")],
)
def test_a_name_in_a_table_stays_in_the_folder(tmp_path: Path, images: str, name: str):
    folder = tmp_path / "folder"
    folder.mkdir()
    (tmp_path / "above.jpg").write_bytes(b"x")
    (folder / "recording.yaml").write_text(LAYOUT % images + CAMERA)
    (folder / "images.csv").write_text(f"filename,t\n{name},0\n")
    with pytest.raises(BadInput, match=r"images\.csv, line 2: .* is not within the recording's folder"):
        open_recording(str(folder))


def test_a_folder_that_describes_itself_describes_no_other(tmp_path: Path):
    (tmp_path / "recording.yaml").write_text(f"folder: /etc\n{LAYOUT % ''}{CAMERA}")
    with pytest.raises(BadInput, match="is not within its own folder"):
        open_recording(str(tmp_path))


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_no_control_character_of_a_file_reaches_a_terminal():
    terminal = Terminal()
    with cleaned(terminal):
        print(f"warning: {ESCAPE}", file=terminal)
    assert terminal.getvalue() == "warning: \\x1b]0;owned\\x07\\x1b[2J\\x9b1m\\x0d\n"
    terminal = Terminal()
    with Progress(terminal) as progress:
        progress.say(ESCAPE)
        progress.begin(ESCAPE, 0, 2)
        progress.update(ESCAPE, 1, 2, ESCAPE)
    assert plain(ESCAPE) in terminal.getvalue()
    assert ESCAPE[:6] not in terminal.getvalue()


def test_of_a_table_no_control_character_reaches_a_terminal(monkeypatch: pytest.MonkeyPatch):
    terminal = Terminal()
    monkeypatch.setattr(sys, "stdout", terminal)
    table = Table("a")
    table.add_row(f"[bold]{ESCAPE}x[/bold]")
    with cleaned(terminal):
        show(table)
    assert "owned" in terminal.getvalue()
    assert not any(code in terminal.getvalue() for code in ("\x1b]", "\x07", "\x1b[2J"))


def test_a_facts_escape_sequences_are_shown_by_a_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.chdir(tmp_path)
    Path("map.omap").write_bytes(artifact_bytes(reference_graph(6), {"variant": ESCAPE, "made_by": ESCAPE}))
    assert main(["map", "show", "map.omap"]) == 0
    out, err = capsys.readouterr()
    assert "owned" in out + err
    assert "\x1b" not in out + err
