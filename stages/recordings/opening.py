"""Opens what a user names as a recording, by the format that fits."""

import importlib
from collections.abc import Sequence
from pathlib import Path

from omninav.pipeline import user_path
from omninav.stages.camera.model import Ring

from .description import known_layouts
from .plausibility import MotionLimits
from .recording import FORMATS, Format, OpenOptions, Recording, Topics, UnreadableRecording
from .stamps import TRUTH_MAX_GAP_S

SHOWN_FILES = 3
"""Largest number of a folder's files that are named."""
MAX_SEARCHED = 20
"""Images of a log, from its first on, in which is looked for what its camera leaves open."""

UNREAD = (".heic", ".heif", ".avif", ".dng", ".cr2", ".cr3", ".nef", ".arw", ".raw")
"""Suffixes of images that OpenCV does not read."""


def open_recording(
    log: str,
    topics: Topics | None = None,
    camera: str | None = None,
    layout_folders: Sequence[str] = (),
    limits: MotionLimits | None = None,
    rate: float | None = None,
    truth_max_gap_s: float = TRUTH_MAX_GAP_S,
) -> Recording:
    """Open what `log` names: a file, a folder, or a layout and a folder (see each format's `open`).

    `camera`: a camera.yaml that replaces the recording's own, or a projection (equirectangular, …) of which the size of
    an image is enough; `layout_folders`: where else descriptions of folders of images are; `limits`: what the robot
    can do; `rate`: images per second of a folder of images without times; `truth_max_gap_s`: the largest time between
    an image and a pose on the topic of true poses. Raises `UnreadableRecording` (or another `BadInput`) with one line:
    file, what is wrong, what to type.
    """
    options = OpenOptions(
        topics or Topics(), camera, tuple(layout_folders), limits or MotionLimits(), rate, truth_max_gap_s
    )
    if log.startswith("camera:"):
        raise UnreadableRecording(
            f"log={log:.60}: a camera that is plugged in runs live: omninav live log={log:.60}; or is recorded first: "
            f"omninav camera record device={log.partition(':')[2]:.40}"
        )
    formats, path = log_formats(), user_path(log)
    meant = next((one for one in formats if one.opens(log)), None)
    if meant is not None and (path.exists() or path.suffix not in meant.suffixes):
        recording = _with_whole_camera(meant.open(log, options))
        if len(recording.stamps) and recording.stamps[0] < 0:
            first = f"its first image is of {recording.stamps[0] / 1e9:.3f} s"
            raise UnreadableRecording(f"{log}: {first}, expected times from 0 on; add a constant to all")
        return recording
    kinds = "; ".join(one.names for one in formats)
    if path.is_dir():
        layouts = ", ".join(sorted(known_layouts(layout_folders)))
        advice = _readable(path, formats) or f"for images with CSVs type log=LAYOUT:{log} (layouts: {layouts})"
        raise UnreadableRecording(f"{log}: no recording is in this folder ({kinds}); {advice}")
    if not path.exists() and any(path.suffix in one.suffixes for one in formats):
        raise UnreadableRecording(f"{log}: no such file{_candidates(path)}")
    if path.name.endswith(".mcap.unfinished") and path.exists():
        again = f"`omninav resume {path.parent}` goes on and closes it, or name it .mcap"
        raise UnreadableRecording(f"{log}: the record of a live run that was stopped; {again}")
    if path.suffix == ".active" and path.exists():
        raise UnreadableRecording(f"{log}: a bag that was never closed; `rosbag reindex` closes it, then name it .bag")
    what = "not a recording" if path.exists() else f"no such file{_candidates(path)}"
    raise UnreadableRecording(f"{log}: {what}; name {kinds}")


def log_formats() -> list[Format]:
    """The formats of this folder and those that a user's code defined; the first that opens a log reads it."""
    for file in sorted(Path(__file__).parent.glob("[a-z]*.py")):
        importlib.import_module(f"{__package__}.{file.stem}")
    return [kind() for kind in sorted(FORMATS, key=lambda kind: kind.__module__)]


def _with_whole_camera(recording: Recording) -> Recording:
    """The recording, its camera with what it leaves open by the first image that shows it (a mirror's ring)."""
    if recording.camera.complete:
        return recording
    counted, details = recording.dropped.copy(), dict(recording.details)
    images = 0
    for frame in range(min(MAX_SEARCHED, len(recording.stamps))):
        pixels = recording.image(frame)
        images += pixels is not None
        camera = None if pixels is None else recording.camera.found_in(pixels)
        if camera is not None and camera.ring is not None:
            recording.camera = camera
            recording.assumed = (*recording.assumed, ring_found_in(recording.name, camera.ring, frame))
            break
    if images and not recording.camera.complete:
        raise UnreadableRecording(
            f"{recording.name}: no ring of a mirror is found in its first {images} images; is it another camera "
            "(camera=…)? If not, give centre and mask in a camera.yaml"
        )
    recording.dropped.clear()  # what is wrong with these images is counted when they are read in their turn
    recording.dropped.update(counted)
    recording.details.clear()
    recording.details.update(details)
    return recording


def ring_found_in(log: str, ring: Ring, frame: int) -> str:
    """Sentence on a mirror's ring that was found in an image."""
    return (
        f"{log}: its mirror's ring is the one in image {frame}, around column {ring.centre_x:.0f} and row "
        f"{ring.centre_y:.0f}, from {ring.inner:.0f} to {ring.outer:.0f} px (centre and mask in a camera.yaml say "
        "otherwise)"
    )


def _readable(folder: Path, formats: Sequence[Format]) -> str:
    """Tells where else images are, or how to make readable ones of a folder's; "" where there are none."""
    inside = sorted(folder.iterdir())
    if any(path.suffix.lower() in UNREAD for path in inside):
        return "HEIC and raw images are not read; export them as JPEG or PNG"
    if parts := [str(path) for path in inside if path.is_file() and any(one.opens(str(path)) for one in formats)]:
        named = ",".join([*parts[:SHOWN_FILES], *(["…"] if len(parts) > SHOWN_FILES else [])])
        return f"type log={named if len(parts) == 1 else f'[{named}]'}"
    below = (path for path in inside if path.is_dir() and any(one.opens(str(path)) for one in formats))
    return next((f"type log={path}" for path in below), "")


def _candidates(path: Path) -> str:
    near = sorted(other.name for other in path.parent.glob(f"*{path.suffix}*")) if path.parent.is_dir() else []
    return f" (in that folder: {', '.join(near[:5])})" if near and path.suffix else ""
