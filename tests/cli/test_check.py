"""What a check finds that composing a configuration cannot: by what is in files, and by the first image."""

from pathlib import Path

import pytest
from conftest import DRIVE, RECORDINGS, TOUR

from omninav.pipeline.cli.main import main

WRONG = {
    "a map of other segments": (
        {"map": RECORDINGS / "references_format_1.omap", "nodes.features.segments": 18},
        "its views are histograms of 10 segments x 20 bins, the current one is histograms of 18 x 20",
    ),
    "no true pose to start at": (
        {"map": RECORDINGS / "references_format_1.omap", "nodes.features.segments": 10, "start": "truth",
         "topics.truth": None},
        "start: no true pose is known at the first image here",
    ),
    "no network": ({"tour": TOUR, "features": "onnx", "model": "/etc/passwd"}, "/etc/passwd: this is no network"),
}  # fmt: skip


@pytest.mark.parametrize(("settings", "what"), WRONG.values(), ids=WRONG)
def test_what_the_first_image_shows_to_be_wrong_is_found(settings, what, tmp_path: Path, monkeypatch, capsys) -> None:
    if "model" in settings:
        pytest.importorskip("onnxruntime")
    monkeypatch.chdir(tmp_path)
    words = [f"{name}={'null' if value is None else value}" for name, value in settings.items()]
    for first in (["check"], []):  # the run says the same
        assert main([*first, "variant=omniview_mcl", f"log={DRIVE}", *words]) == 2
        assert what in capsys.readouterr().err


@pytest.mark.parametrize(
    ("word", "said"),
    [
        ("nodes.features=null", "artifacts.map.inherit: there is no node 'features'"),
        ("nodes.features=5", "nodes.features: a node needs `_target_`"),
        ("nodes.source=5", "nodes.source: a node needs `_target_`"),
    ],
)
def test_a_node_that_is_taken_out_or_is_none_is_said_to_be_missed(word: str, said: str, capsys) -> None:
    assert main(["check", "variant=omniview_mcl", word]) == 2
    assert said in capsys.readouterr().err


def test_an_engine_that_a_sweep_refuses_is_refused(tmp_path: Path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["check", "variant=omniview_cml", f"log={DRIVE}", "executor.workers=-1"]) == 2
    assert "executor.workers: -1, expected a whole number >= 1" in capsys.readouterr().err
    assert main(["check", "-m", "variant=omniview_mcl", "match=selective,l2"]) == 2
    assert "check: it checks one run; type it without -m" in capsys.readouterr().err


def test_an_objective_that_no_stage_measures_is_refused_before_the_run(tmp_path: Path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    words = ["variant=omniview_cml", f"log={DRIVE}"]
    for first in (["check"], []):
        assert main([*first, *words, "objective=position_eror_m.median"]) == 2
        said = "no stage of this graph measures 'position_eror_m'; did you mean 'position_error_m'?"
        assert said in capsys.readouterr().err
    for named in ("position_error_m.median", "after_convergence.loss_rate"):
        assert main(["check", *words, f"objective={named}"]) == 0
    assert not list(tmp_path.iterdir())


def test_a_folder_that_the_run_cannot_take_is_refused(tmp_path: Path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    words = ["check", "variant=wander", "cache=null"]
    assert main([*words, "hydra.run.dir=/proc/x"]) == 2
    assert "hydra.run.dir=/proc/x: /proc: nothing can be written there" in capsys.readouterr().err
    (tmp_path / "done").mkdir()
    (tmp_path / "done" / "manifest.json").write_text("{}")
    assert main([*words, "hydra.run.dir=done"]) == 2
    assert "done: there is a run in it" in capsys.readouterr().err
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "truth.tum").write_text("1 2 3\n")
    assert main([*words, "hydra.run.dir=data"]) == 2
    assert "data: it holds truth.tum, which a run might overwrite; name an empty folder" in capsys.readouterr().err
    assert main([*words, "hydra.run.dir=new"]) == 0
    assert not (tmp_path / "new").exists()
