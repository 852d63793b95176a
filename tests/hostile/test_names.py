"""Names in files: none leads out of its folder, none is a program for a terminal, and each is of its type."""

import io
import shutil
import sys
from pathlib import Path

import made_values
import pytest
from conftest import DATA, needs_data

from omninav.pipeline import BadInput
from omninav.pipeline.cli.main import main
from omninav.pipeline.cli.terminal import show
from omninav.pipeline.engine.artifact import artifact_bytes, read_artifact, read_header
from omninav.pipeline.report.progress import Progress
from omninav.pipeline.report.terminal_text import cleaned, plain
from omninav.stages.recordings.opening import open_recording

NEW = DATA / "hostile" / "new"
ESCAPE = "\x1b]0;owned\x07\x1b[2J\x9b1m\r"


@pytest.mark.parametrize(
    "name", ["../../above", "/tmp/omninav_absolute", "a" * 300, "a\\0b", "a b", "", "a.b", "ä", "\\e[2J"]
)
def test_an_experiments_name_is_a_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], name: str
):
    monkeypatch.chdir(tmp_path)
    Path("my/experiment").mkdir(parents=True)
    Path("my/experiment/mine.yaml").write_text(
        f'# @package experiment\ndefaults: [test_worlds, _self_]\nname: "{name}"\ntitle: T\nabout: A\n'
        "variant: omniview_mcl\nset: start=truth\nsweep: {match: {a: match=selective, b: match=l2}}\n"
        "measures: {error: {title: E, path: [position_error_m.median], digits: 2}}\nclaims: {}\n"
        "page: {rows: [], columns: match}\n"
    )
    for command in ([], ["check"]):
        assert main([*command, "--config-dir=my", "+experiment=mine"]) == 2
        said = capsys.readouterr().err
        assert "experiment.name" in said
        assert "Traceback" not in said
    assert not Path("/tmp/omninav_absolute").exists()


@needs_data
@pytest.mark.parametrize("name", ["nul", "above", "absolute", "long"])
def test_an_experiment_among_the_examples_is_refused(name: str, capsys: pytest.CaptureFixture[str]):
    assert main(["check", f"--config-dir={NEW / 'experiment_name'}", f"+experiment={name}"]) == 2
    assert "experiment.name: " in capsys.readouterr().err


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


@needs_data
def test_the_example_of_names_above_is_refused(tmp_path: Path):
    folder = tmp_path / "table_names_above"
    shutil.copytree(NEW / "table_names_above", folder)
    shutil.copy(NEW / "above.jpg", tmp_path)
    with pytest.raises(BadInput, match="is not within the recording's folder"):
        open_recording(f"{folder}/layout.yaml:{folder}")


@pytest.mark.parametrize(
    ("fact", "value"),
    [
        ("dropped", 5),
        ("dropped", {"bad_chunk": "x"}),
        ("dropped", {"bad_chunk": {"first": "x"}}),
        ("dropped", {"bad_chunk": {"count": 1, "first": 2}}),
        ("facts", [1]),
        ("stages", 7),
        ("stages", {"features": 1}),
        ("variant", {}),
        ("made_by", 1),
        ("warnings", "x"),
        ("warnings", [1]),
    ],
)
def test_a_maps_facts_are_of_their_types(tmp_path: Path, fact: str, value: object):
    file = tmp_path / "map.omap"
    file.write_bytes(artifact_bytes(made_values.made_values()[0], {fact: value}))
    for read in (read_header, read_artifact):
        with pytest.raises(BadInput, match=f"its header's {fact} is"):
            read(file)


@needs_data
def test_the_example_of_a_map_with_facts_of_wrong_types_is_refused_when_it_is_opened():
    with pytest.raises(BadInput, match="its header's dropped is 5, expected counts by kind"):
        read_artifact(NEW / "map_facts_of_wrong_types.omap")


def test_no_control_character_of_a_file_reaches_a_terminal():
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

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
    from rich.table import Table

    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    terminal = Terminal()
    monkeypatch.setattr(sys, "stdout", terminal)
    table = Table("a")
    table.add_row(f"[bold]{ESCAPE}x[/bold]")
    with cleaned(terminal):
        show(table)
    assert "\x1b]" not in terminal.getvalue()
    assert "\x07" not in terminal.getvalue()
    assert "\x1b[2J" not in terminal.getvalue()
    assert "owned" in terminal.getvalue()


def test_a_facts_escape_sequences_are_shown_by_a_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.chdir(tmp_path)
    Path("map.omap").write_bytes(artifact_bytes(made_values.made_values()[0], {"variant": ESCAPE, "made_by": ESCAPE}))
    assert main(["map", "show", "map.omap"]) == 0
    out, err = capsys.readouterr()
    assert "owned" in out + err
    assert "\x1b" not in out + err
