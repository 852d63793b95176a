"""Ctrl-C: the run to resume is named, and no other one."""

import importlib
import pkgutil
from operator import attrgetter
from pathlib import Path

import pytest
from omegaconf import OmegaConf

from omninav.pipeline.cli.main import main
from omninav.pipeline.engine.engine import Engine
from omninav.pipeline.files import read_json
from omninav.pipeline.run.run_folder import RunFolder

from .test_hydra_folders import VARIANT

RUN = ["--config-dir=mine", "variant=toy"]


def stop(*_: object) -> None:
    raise KeyboardInterrupt


@pytest.fixture(autouse=True)
def toy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "mine" / "variant").mkdir(parents=True)
    (tmp_path / "mine" / "variant" / "toy.yaml").write_text(VARIANT)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "runs" / "of_yesterday").mkdir(parents=True)
    (tmp_path / "runs" / "latest").symlink_to("of_yesterday")


def test_in_its_loop_its_own_folder_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys):
    monkeypatch.setattr(Engine, "tick", stop)
    assert main(RUN) == 130
    (folder,) = (tmp_path / "runs").glob("*_toy")
    assert capsys.readouterr().err.splitlines()[-1] == f"stopped; `omninav resume runs/{folder.name} toys` continues it"
    assert main(["resume", str(folder), "toys"]) == 130
    assert capsys.readouterr().err.splitlines()[-1] == "stopped; the same command continues it"


def test_before_its_folder_is_whole_nothing_is_named_and_nothing_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys
):
    monkeypatch.setattr(RunFolder, "describe", stop)
    assert main(RUN) == 130
    assert capsys.readouterr().err.splitlines()[-1] == "stopped before it had begun"
    assert sorted(path.name for path in (tmp_path / "runs").iterdir()) == ["latest", "of_yesterday"]


@pytest.mark.parametrize(
    "last", ["run.execution.Engine.close", "run.execution.read_metrics", "cli.terminal.read_timing"]
)
def test_once_it_is_complete_its_results_are_shown(last: str, monkeypatch: pytest.MonkeyPatch, capsys):
    found, stops = pkgutil.resolve_name(f"omninav.pipeline.{last}"), [stop]
    monkeypatch.setattr(f"omninav.pipeline.{last}", lambda *given: (stops.pop() if stops else found)(*given))
    assert main(RUN) == 0
    assert "report: runs/" in capsys.readouterr().out
    assert (read_json(Path("runs/latest/manifest.json"))["status"], stops) == ("complete", [])


def test_a_command_that_is_no_run_names_none(monkeypatch: pytest.MonkeyPatch, capsys):
    monkeypatch.setattr(importlib.import_module("omninav.pipeline.cli.commands.doctor"), "command", stop)
    assert main(["doctor"]) == 130
    assert capsys.readouterr().err == "stopped\n"


@pytest.mark.parametrize("where", ["hydra_session.CheckedLoader._refuse_foreign", "composition.take_stand_ins"])
def test_an_error_that_a_library_raises_as_it_is_stopped_is_none(
    where: str, monkeypatch: pytest.MonkeyPatch, capsys
) -> None:
    def stumble(*_: object) -> None:
        try:
            raise KeyboardInterrupt
        finally:
            attrgetter("a.b")(OmegaConf.create({"a": 1}))  # as OmegaConf's own clean-up

    monkeypatch.setattr(f"omninav.pipeline.cli.{where}", stumble)
    assert main(RUN) == 130
    assert capsys.readouterr().err.splitlines()[-1].startswith("stopped")
