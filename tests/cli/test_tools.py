"""Commands that variants without a source are: two words, one file."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from omninav.pipeline.cli.main import main


def test_a_camera_is_looked_through(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for number in range(2):
        pixels = np.random.default_rng(number).integers(0, 256, (32, 64, 3), dtype=np.uint8)
        cv2.imwrite(str(tmp_path / f"{number}.png"), pixels)
    out = tmp_path / "look.png"
    assert main(["camera", "look", f"log={tmp_path}", f"out={out}", "frame=1"]) == 0
    assert "image 1, equirectangular camera" in capsys.readouterr().out
    assert cv2.imread(str(out)) is not None
    assert not list(tmp_path.glob("runs*"))


def test_a_variant_that_runs_over_a_log_is_no_such_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["omniview", "mcl_map", "log=L"]) == 2
    assert main(["camera", "lok"]) == 2
    assert main(["homing"]) == 2
    said = capsys.readouterr().err
    assert "type omninav variant=omniview_mcl_map" in said
    assert "'camera' is no command. there are: omninav camera calibrate, omninav camera look" in said
    assert "'homing' is no command. type omninav variant=homing" in said


def test_check_finds_what_images_alone_do_not_serve(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for number in range(3):
        noise = np.random.default_rng(number).integers(0, 256, (40, 80, 3), dtype=np.uint8)
        cv2.imwrite(str(tmp_path / f"{number}.png"), noise)
    words = [f"tour={tmp_path}", f"log={tmp_path}", "camera=equirectangular"]
    assert main(["check", "variant=omniview_mcl", *words]) == 2
    assert "needed by 'mapping'; type speed=" in capsys.readouterr().err
    assert main(["check", "variant=topological_localisation", *words]) == 0
