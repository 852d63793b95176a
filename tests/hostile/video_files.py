"""Videos, and files of true poses that lie beside them."""

import functools
import tempfile
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from omninav.stages.recordings.opening import open_recording
from omninav.stages.recordings.plausibility import MotionLimits
from omninav.stages.recordings.truth_file import read_trajectory, truth_from

from .harness import Format, Wrong, not_finite
from .mutations import BINARY, TEXT, Files, on

FRAMES = 6
KINDS = (("mp4", "mp4v"), ("avi", "MJPG"), ("mkv", "MJPG"))
ROWS = [(1.5 * n, 0.4 * n, -0.1 * n, 0.02 * n) for n in range(12)]
TUM = "# timestamp x y z qx qy qz qw\n" + "".join(f"{t} {x:.3f} {y:.3f} 0 0 0 {h:.3f} 1\n" for t, x, y, h in ROWS)
CSV = "time [s],x [cm],y_mm,heading_deg\n" + "".join(
    f"{t},{100 * x:.1f},{1000 * y:.0f},{57 * h:.2f}\n" for t, x, y, h in ROWS
)


@functools.cache
def videos() -> Sequence[Files]:
    """A short video in each container."""
    pixels = np.random.default_rng(0).integers(0, 256, (FRAMES, 32, 64, 3), dtype=np.uint8)
    found = []
    with tempfile.TemporaryDirectory() as scratch:
        for container, code in KINDS:
            file = Path(scratch, f"drive.{container}")
            writer = cv2.VideoWriter(str(file), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*code), 2.0, (64, 32))
            for image in pixels:
                writer.write(image)
            writer.release()
            found.append({file.name: file.read_bytes()})
    return found


def trajectories() -> Sequence[Files]:
    """Files of true poses of both kinds."""
    return [{"truth.txt": TUM.encode()}, {"truth.txt": CSV.encode()}]


def frames_of(folder: Path, files: Files) -> Any:
    """Every image of a video."""
    name = next(iter(files))
    recording = open_recording(str(folder / name), camera="equirectangular")
    if len(recording.stamps) > 1 and not (np.diff(recording.stamps) > 0).all():
        raise Wrong("stamps do not ascend")
    read = [frame for frame in range(min(len(recording.stamps), 4 * FRAMES)) if recording.image(frame) is not None]
    stated = cv2.VideoCapture(str(folder / name)).get(cv2.CAP_PROP_FRAME_COUNT)  # none, where that is what is damaged
    if len(read) < min(FRAMES, stated) and not recording.dropped:
        raise Wrong(f"{FRAMES - len(read)} images are missing, and nothing was counted")
    recording.digest()
    not_finite(recording.camera, "camera")


def truth_of(folder: Path, files: Files) -> Any:
    """The poses of a file, and those of the images of a recording."""
    stamps, poses, *_ = read_trajectory(folder / "truth.txt")
    if not (np.diff(stamps) > 0).all():
        raise Wrong("stamps do not ascend")
    recording = _Images(np.arange(1, FRAMES) * 1_100_000_000)
    truth, _ = truth_from(recording, folder / "truth.txt", 0.0, 1.0, MotionLimits())  # type: ignore[arg-type]
    if np.isinf(truth).any() or (np.isnan(truth).any() and not recording.dropped):
        raise Wrong(f"poses that are none, and nothing was counted: {truth}")
    return poses


class _Images:
    """As much of a recording as is asked for its images' times."""

    name = "drive.mp4"

    def __init__(self, stamps: Any) -> None:
        self.stamps = stamps
        self.dropped: Counter[str] = Counter()
        self.details: dict[str, str] = {}


VIDEO = Format("video", videos, [on(BINARY)], frames_of, cases=100, cpu_s=2, may_crash=True)
TRUTH = Format("truth file", trajectories, [on(TEXT)], truth_of, cases=300)
