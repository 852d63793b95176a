"""From what a user names to a recording: MCAP, rosbag2 folder, ROS 1 bag, or a described folder of images."""

from collections.abc import Sequence
from pathlib import Path

from .recording import Recording, UnreadableRecording
from .topics import Topics

KINDS = "a .mcap or .bag file, a rosbag2 folder, LAYOUT:FOLDER, a description .yaml, or a folder with recording.yaml"


def open_recording(
    log: str, topics: Topics | None = None, camera: str | None = None, layouts: Sequence[str] = ()
) -> Recording:
    """Open what `log` names.

    `camera`: a camera.yaml that replaces the recording's own. `layouts`: folders with further descriptions of image
    folders. Raises `UnreadableRecording` (or another `BadInput`) with one line: file, what is wrong, what to type.
    """
    topics = topics or Topics()
    described = camera and Path(camera).expanduser()
    path = Path(log).expanduser()
    if path.suffix == ".mcap" and not path.is_dir():
        from .mcap import open_mcap

        return open_mcap(log, [_existing(path)], topics, described or None)
    raise UnreadableRecording(f"{log}: not a recording; name {KINDS}")


def _existing(path: Path) -> Path:
    if path.exists():
        return path
    near = [other.name for other in path.parent.glob(f"*{path.suffix}")] if path.parent.is_dir() else []
    beside = f"; in that folder: {', '.join(sorted(near)[:5])}" if near else ""
    raise UnreadableRecording(f"{path}: no such file{beside}")
