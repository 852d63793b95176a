"""Commands with arguments of their own, which write files and leave no run."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from small_run import reference_graph

import omninav
from omninav.pipeline.cli.main import main
from omninav.pipeline.engine.artifact import read_artifact, write_artifact
from omninav.stages.values.maps import ReferenceGraph


def test_a_variant_that_runs_over_a_log_is_no_such_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["homing", "field", "log=L"]) == 2
    assert main(["camera", "lok"]) == 2
    assert main(["homing"]) == 2
    said = capsys.readouterr().err
    assert "type omninav variant=homing_field" in said
    assert "'camera lok' is no command. did you mean 'omninav camera look'? there are: omninav camera calibrate" in said
    assert "'homing' is no command. type omninav variant=homing" in said


def test_check_finds_what_images_alone_do_not_serve(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for number in range(3):
        noise = np.random.default_rng(number).integers(0, 256, (40, 80, 3), dtype=np.uint8)
        cv2.imwrite(str(tmp_path / f"{number}.png"), noise)
    words = [f"tour={tmp_path}", f"log={tmp_path}", "camera=equirectangular"]
    assert main(["check", "variant=omniview_mcl", *words]) == 2
    assert "needed by 'mapping'; type speed=" in capsys.readouterr().err
    assert main(["check", "variant=topological_localisation", *words]) == 0


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("map cut a.omap", "area: it is needed"),
        ("map cut a.omap area=[0,0,1,1] uot=b.omap", "did you mean 'out'? parameters: area, maps, out"),
        ("map cut a.omap area=0,0,1,1", "several as 'name=[A,B]'"),
        ("map cut a.omap area=[0,0,1,1] ~out", "there is nothing to take out"),
        ("map thin a.omap spacing=-1", "spacing: -1.0 is out of bounds, expected float > 0"),
        ("camera look", "type log=…: A log of any kind."),
        ("camera look a.mcap topics.imag=/x", "topics.imag: Topics has no parameter 'imag'"),
        ("simulate rouet=tour log=a.mcap", "did you mean 'route'?"),
        ("simulate log=a.mcap world=ofice", "did you mean 'world=office'?"),
        ("variant=map_cut", "it is a command; type omninav map cut"),
        ("variant=simulate_live live=dds", "it is a command; type omninav simulate"),
    ],
)
def test_arguments_that_do_not_fit_are_said(words: str, said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(words.split()) == 2
    assert said in capsys.readouterr().err


def test_a_tool_is_called_from_python(tmp_path: Path) -> None:
    whole = tmp_path / "a.omap"
    write_artifact(whole, reference_graph(20))
    omninav.tool("map cut", str(whole), area=[0, -4, 8, 4], out=tmp_path / "b=c.omap")
    cut = read_artifact(tmp_path / "b=c.omap")
    assert main(["map", "show", "b=c.omap"]) == 0  # a file, and no argument
    assert isinstance(cut, ReferenceGraph)
    assert 0 < len(cut) < 20
    with pytest.raises(omninav.BadInput, match=r"'map cot': there is no such tool; did you mean 'map cut'\?"):
        omninav.tool("map cot", str(whole))


def test_a_drive_is_localised_in_a_joined_and_in_a_thinned_map(demo: Path, shared_cache: Path, tmp_path: Path) -> None:
    whole = demo / "map.omap"
    for side, area in (("left", "[-99,-99,5,99]"), ("right", "[5,-99,99,99]")):
        assert main(["map", "cut", str(whole), f"area={area}", f"out={side}.omap"]) == 0
    assert main(["map", "join", "left.omap", "right.omap", "out=both.omap"]) == 0
    assert main(["map", "thin", "both.omap", "spacing=0.6", "out=few.omap"]) == 0
    references = {}
    for name in ("both", "few"):
        words = (f"map={name}.omap", f"cache={shared_cache}", "nodes.source.stop=10", "plots=none")
        assert main([*words, f"hydra.run.dir=runs/{name}"]) == 0
        metrics = json.loads((tmp_path / "runs" / name / "metrics.json").read_text())
        assert metrics["position_error_m"]["median"] < 0.5
        references[name] = metrics["map"]["references"]
    assert references["few"] < 0.8 * references["both"]
    assert references["both"] == len(read_artifact(whole))  # type: ignore[arg-type]
