"""Our trajectory errors beside those of evo (Grupp 2017), which reads trajectory.tum and truth.tum of a run."""

import json
import math
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
from measured_drives import figures, made_drive

from omninav.pipeline import Context
from omninav.stages.metrics.relative_errors import RelativeErrors
from omninav.stages.plots.trajectory_file import TrajectoryFile

EVO = Path(sys.executable).parent
pytestmark = pytest.mark.skipif(not (EVO / "evo_ape").exists(), reason="evo is not installed: pip install -e '.[dev]'")
SAME = 1e-6


def evo(place: Path, *words: str) -> dict[str, float]:
    """What `evo_ape` or `evo_rpe` say of trajectory.tum against truth.tum in this folder."""
    command = [EVO / words[0], "tum", "truth.tum", "trajectory.tum", *words[1:], "--save_results", "result.zip"]
    (place / "result.zip").unlink(missing_ok=True)
    environment = {**os.environ, "HOME": str(place), "MPLBACKEND": "Agg"}
    ended = subprocess.run(command, cwd=place, capture_output=True, text=True, env=environment, timeout=120)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    with zipfile.ZipFile(place / "result.zip") as result:
        return json.loads(result.read("stats.json"))


def assert_same(ours: dict[str, float], theirs: dict[str, float]) -> None:
    assert ours == pytest.approx({name: theirs[name] for name in ("rmse", "mean", "median", "max")}, abs=SAME)


def test_absolute_and_relative_errors_are_evos(tmp_path: Path):
    """Of a robot that takes equal steps, so that the first image 1 m further on is also the one nearest to 1 m."""
    rng, step_m = np.random.default_rng(8), 0.25
    headings = np.cumsum(rng.normal(0.0, 0.2, 60))
    steps = step_m * np.column_stack([np.cos(headings), np.sin(headings)])
    truth = np.column_stack([np.cumsum(steps, axis=0), headings])
    estimate = truth + rng.normal(0.0, (0.1, 0.1, 0.05), truth.shape)
    drive = made_drive(truth, estimate)
    TrajectoryFile().step(Context("file", folder=tmp_path), drive)
    ours = figures(RelativeErrors(distance_m=1.0), drive)
    pairs = ("evo_rpe", "--delta", "1", "--delta_unit", "m", "--all_pairs", "--pairs_from_reference")
    assert_same(ours["relative_position_error_m"], evo(tmp_path, *pairs, "--pose_relation", "trans_part"))
    assert_same(ours["relative_heading_error_deg"], evo(tmp_path, *pairs, "--pose_relation", "angle_deg"))
    assert_same(ours["absolute_trajectory_error_m"], evo(tmp_path, "evo_ape", "--align"))
    assert not math.isclose(ours["relative_position_error_m"]["rmse"], ours["absolute_trajectory_error_m"]["rmse"])
