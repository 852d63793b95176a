"""What a frame costs that a program pushes, beside the engine's own tick over a recording of the same frames."""

import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

import omninav
from omninav.pipeline.engine.engine import Engine
from omninav.pipeline.run.execution import running
from omninav.pipeline.run.run_folder import start
from omninav.stages.recordings.camera_yaml import write_camera
from omninav.stages.recordings.opening import open_recording

from .table import Row

DATA = Path(__file__).resolve().parents[1] / "tests" / "data"
FIRST = 5
"""Frames before the clock counts: compiled code is loaded in them."""


def rows() -> list[Row]:
    """Median over the frames of `omniview_mcl` with 500 particles: a session's step, and the batch engine's tick."""
    tour, drive = str(DATA / "tour.mcap"), str(DATA / "drive.mcap")
    words = {"nodes.prior.number": 500, "cache": None, "plots": "none", "checkpoint_s": 1e6}
    recording = open_recording(drive)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        (folder / "camera.yaml").write_text(write_camera(recording.camera))
        made = omninav.compose("omniview_mcl", tour=tour, log=drive, **words)
        with running(start(made.prepared, ["omninav"], folder / "batch"), made.prepared) as engine:
            batch = _ticks(engine)
        settings: dict[str, Any] = {"map": folder / "batch" / "map.omap", "camera": folder / "camera.yaml", **words}
        with omninav.open("omniview_mcl", folder=folder / "session", **settings) as session:
            pushed = []
            for k, stamp in enumerate(recording.stamps):
                begun = time.perf_counter()
                session.step(image=recording.image(k), odometry=recording.odometry[k], stamp=stamp)
                pushed.append(time.perf_counter() - begun)
    ours, theirs = (1e3 * float(np.median(times[FIRST:])) for times in (pushed, batch))
    return [
        Row("session.step, image decoding included", ours, "ms", "the engine's tick", theirs, limit=1.1, of_peer=True)
    ]


def _ticks(engine: Engine) -> list[float]:
    found, begun = [], time.perf_counter()
    while engine.tick():
        now = time.perf_counter()
        found.append(now - begun)
        begun = now
    return found
