"""From what a user names to a recording: MCAP, rosbag2 folder, ROS 1 bag, or a described folder of images."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from .description import find_layout, known_layouts, read_description
from .image_folder import ImageFolder
from .recording import Recording, UnreadableRecording
from .topics import Topics

KINDS = "a .mcap or .bag file, a rosbag2 folder, LAYOUT:FOLDER, a description .yaml, or a folder with recording.yaml"
BAG_SUFFIXES = (".bag", ".db3")


def open_recording(
    log: str, topics: Topics | None = None, camera: str | None = None, layouts: Sequence[str] = ()
) -> Recording:
    """Open what `log` names.

    * `drive.mcap`, `drive.bag`, `drive.db3`, or a rosbag2 folder;
    * `LAYOUT:FOLDER` or `LAYOUT:FOLDER:WHICH`: images and CSVs described by a built-in LAYOUT, one in the folders
      `layouts`, or a path to a .yaml; WHICH stands for `{which}` in its file names;
    * a description .yaml with its own `folder` (relative to the file), or a folder that holds `recording.yaml`.

    `camera`: a camera.yaml that replaces the recording's own.
    Raises `UnreadableRecording` (or another `BadInput`) with one line: file, what is wrong, what to type.
    """
    topics, view = topics or Topics(), None if camera is None else Path(camera).expanduser()
    path = Path(log).expanduser()
    if path.is_dir():
        return _open_folder(log, path, topics, view, layouts)
    if path.suffix == ".mcap" or path.suffix in BAG_SUFFIXES:
        if not path.exists():
            raise UnreadableRecording(f"{path}: no such file{_beside(path)}")
        if path.suffix == ".mcap":
            from .mcap import open_mcap

            return open_mcap(log, [path], topics, view)
        from .rosbag import open_rosbag

        return open_rosbag(log, path, topics, view)
    if path.suffix in (".yaml", ".yml") and path.is_file():
        return _described(log, path, path.parent, "", view, layouts)
    if ":" in log:
        layout, _, rest = log.partition(":")
        folder, which = Path(rest).expanduser(), ""
        if not folder.exists() and ":" in rest:
            rest, _, which = rest.rpartition(":")
            folder = Path(rest).expanduser()
        return _described(log, find_layout(layout, layouts), folder, which, view, layouts, given=True)
    what = "not a recording" if path.exists() else f"no such file{_beside(path)}"
    raise UnreadableRecording(f"{log}: {what}; name {KINDS}")


def _open_folder(log: str, path: Path, topics: Topics, camera: Path | None, layouts: Sequence[str]) -> Recording:
    if (path / "recording.yaml").is_file():
        return _described(log, path / "recording.yaml", path, "", camera, layouts)
    if (path / "metadata.yaml").is_file() or any(path.glob("*.mcap")) or any(path.glob("*.db3")):
        from .rosbag import open_rosbag

        return open_rosbag(log, path, topics, camera)
    raise UnreadableRecording(
        f"{log}: a folder without metadata.yaml (rosbag2) or recording.yaml; for images with CSVs type "
        f"log=LAYOUT:{log} (layouts: {', '.join(sorted(known_layouts(layouts)))})"
    )


def _described(
    log: str, file: Path, folder: Path, which: str, camera: Path | None, layouts: Sequence[str], given: bool = False
) -> Recording:
    description = read_description(file, layouts)
    if not given and description.folder is not None:
        folder = file.parent / Path(description.folder).expanduser()
    elif not given and file.name != "recording.yaml":
        raise UnreadableRecording(f"{file}: folder is missing; type log={file}:FOLDER, or write folder: … into it")
    if which:
        description = replace(description, which=which)
    return ImageFolder(log, folder, description, str(file), camera)


def _beside(path: Path) -> str:
    near = sorted(other.name for other in path.parent.glob(f"*{path.suffix}")) if path.parent.is_dir() else []
    return f" (in that folder: {', '.join(near[:5])})" if near and path.suffix else ""
