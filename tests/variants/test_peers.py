"""The localisers of others in benchmarks/peers, on a small tour and drive."""

import json
from contextlib import chdir
from pathlib import Path

import numpy as np
import pytest
from golden_figures import DATA, DRIVE, PEERS, TOUR

from omninav.pipeline.cli.main import main
from omninav.stages.recordings.opening import open_recording

MEDIAN_M = 0.45
"""Largest median error on this drive, which goes some 0.35 m beside the tour."""


def run(place: Path, program: str, *words: str) -> Path:
    place.mkdir(parents=True, exist_ok=True)
    with chdir(place):
        command = f'command="python {PEERS / program}"'
        assert main(("variant=peer", command, TOUR, DRIVE, "cache=cache", "plots=none", *words)) == 0
        return (place / "runs" / "latest").resolve()


@pytest.mark.parametrize("name", ["hidden_markov", "particle_filter", "visual_words"])
def test_those_of_opencv_and_numpy_find_the_way_on_a_small_drive(name: str, tmp_path: Path):
    metrics = json.loads((run(tmp_path, f"{name}.py") / "metrics.json").read_text())
    assert metrics["position_error_m"]["median"] < MEDIAN_M
    assert metrics["peer"]["without_pose"] < 0.1
    assert metrics["peer"]["kept_mb"] > 0.01
    assert 0 < metrics["peer"]["image_cpu_ms"] < 1e3 * metrics["peer"]["cpu_s"]


def test_a_trajectory_of_another_program_is_read_in_each_of_the_usual_formats(tmp_path: Path):
    recording = open_recording(str(DATA / "drive.mcap"))
    heading = recording.truth[:, 2]
    rows = np.zeros((len(heading), 8))
    rows[:, 0], rows[:, 1:3] = recording.stamps / 1e9, recording.truth[:, :2]
    rows[:, 6], rows[:, 7] = np.sin(heading / 2), np.cos(heading / 2)
    np.savetxt(tmp_path / "tum.txt", rows, fmt="%.9f")
    lines = [f"{line} {number}" for number, line in enumerate((tmp_path / "tum.txt").read_text().splitlines())]
    (tmp_path / "rtabmap.txt").write_text("#timestamp x y z qx qy qz qw id\n" + "\n".join(lines))
    matrices = np.zeros((len(rows), 3, 4))
    matrices[:, 0, 2], matrices[:, 1, 2] = np.cos(heading), np.sin(heading)  # a camera that looks forward
    matrices[:, :, 3] = rows[:, 1:4]
    np.savetxt(tmp_path / "kitti.txt", matrices.reshape(-1, 12))
    for words in ("tum.txt", "rtabmap.txt", "kitti.txt camera"):
        found = run(tmp_path, f"trajectory_file.py {words}") / "trajectory.tum"
        assert np.loadtxt(found)[:, :4] == pytest.approx(rows[:, :4], abs=1e-6)
        turned = np.loadtxt(found)[:, 6:] * np.sign(np.loadtxt(found)[:, 7:])
        assert turned == pytest.approx(rows[:, 6:] * np.sign(rows[:, 7:]), abs=1e-6)
