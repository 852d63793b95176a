"""Two walks of which there are images and nothing else: one becomes a map, and the other is localised in it."""

import json
from pathlib import Path

import cv2
import numpy as np
from conftest import DRIVE, TOUR

from omninav.pipeline.cli.main import main
from omninav.stages.recordings.opening import open_recording


def images_alone(log: Path, folder: Path) -> np.ndarray:
    """Write the images of a log into a folder. Returns their true positions (N, 2)."""
    recording, kept = open_recording(str(log)), []
    folder.mkdir()
    for number in range(len(recording.stamps)):
        pixels = recording.image(number)
        if pixels is not None:
            cv2.imwrite(str(folder / f"{number:03d}.png"), pixels)
            kept.append(number)
    assert recording.truth is not None
    return recording.truth[kept, :2]


def test_a_walk_becomes_a_map_and_another_is_localised_in_it_without_odometry(
    tmp_path: Path, shared_cache: Path
) -> None:
    images_alone(TOUR, tmp_path / "tour")
    truth = images_alone(DRIVE, tmp_path / "drive")
    line = ["+artifacts.map.nodes.source.stop=37", "nodes.source.stop=26"]  # the first halves
    line += [f"tour={tmp_path / 'tour'}", f"log={tmp_path / 'drive'}", f"camera={TOUR.with_name('camera.yaml')}"]
    assert main([*line, "plots=none", f"cache={shared_cache}", f"runs={tmp_path / 'runs'}"]) == 0
    run = tmp_path / "runs" / "latest"
    for trajectory in ("trajectory.tum", "trajectory_smoothed.tum"):
        rows = np.loadtxt(run / trajectory)
        found, true = rows[:, 1] + 1j * rows[:, 2], truth[: len(rows), 0] + 1j * truth[: len(rows), 1]
        found, true = found - found.mean(), true - true.mean()
        errors = np.abs((found.conj() * true).sum() / (np.abs(found) ** 2).sum() * found - true)
        assert np.sqrt((errors**2).mean()) < 0.1, trajectory  # images of 280 x 210 pixels
    manifest = json.loads((run / "manifest.json").read_text())
    assert manifest["facts"]["scale"] == "of the motion seen in the images: by the map's landmarks"
    assert any("write the height (m) into its camera.yaml" in each for each in manifest["warnings"])
