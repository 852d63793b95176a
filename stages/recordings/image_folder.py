"""Folders of images with CSVs of times and positions, read by a description: everything about them is configuration."""

import hashlib
import os
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from omninav.pipeline import BadInput, digest_file, read_small, shown, user_path
from omninav.stages.camera.model import Camera, camera_models
from omninav.stages.geometry.arrays import Array, Ints
from omninav.stages.values.encoded_image import EXIF_BYTES, MAX_FILE_BYTES, Undecodable, decode_image, orientation_of
from omninav.stages.values.image import Pixels

from .camera_yaml import camera_from, read_camera
from .description import FAR, MAX_NAME, MAX_PATTERN, Description, Rename, find_layout, read_description
from .named_camera import assumed_camera, named_camera
from .positions import frame_poses
from .recording import DecodeAhead, Format, OpenOptions, Recording, UnreadableRecording, checked_image
from .stamps import Stamps, ascending, lone
from .tables import NO_TIME, CsvTable, Delimiter, by_numbers, read_table, table_of

MAX_STARS = 8
"""Wildcards in the name of a file."""
MAX_DIGITS = 10
"""Digits of an image's number."""


class ImageFolder(Recording):
    """A described folder of images as a `Recording`. It may have positions (as truth), and has no odometry.

    Images are turned as the EXIF orientation of JPEG and PNG files states (`turned`).
    Counted in `dropped`: `missing_image`, `impossible_motion`, `no_position`, `no_time`, `duplicate_frame`,
    `backward_stamp`, `lone_stamp`, and when images are read `undecodable_image`, `blank_image`, `wrong_size`.
    Raises `UnreadableRecording` for a file or column that is not there, and where nothing usable remains.
    """

    def __init__(self, name: str, folder: Path, description: Description, where: str, options: OpenOptions) -> None:
        super().__init__()
        self.name = name
        self._folder, self._description, self._where = folder, description, where
        if not folder.is_dir():
            raise UnreadableRecording(f"{folder}: no such folder")
        self._sources: list[Path] = []
        self._rows: list[str] = []
        frames = self._table(description.frames.csv, description.frames.header, description.frames.delimiter)
        paths = self._paths(frames)
        if description.frames.name is not None:
            frames = names_table(paths, description.frames.name)
            order = np.argsort(self._times(frames, len(paths)), kind="stable")  # names need not begin with the time
            paths = [paths[row] for row in order]
            frames = names_table(paths, description.frames.name)
        times = self._times(frames, len(paths))
        truth, positions = None, description.positions
        if positions is not None:
            own = self._table(positions.csv, positions.header, positions.delimiter)
            truth, unlikely = frame_poses(description, where, frames, own, times, options.limits)
            for what in unlikely:
                self._drop("impossible_motion", what)
        keep = self._usable(paths, times, truth)
        self.paths = [paths[row] for row in keep]
        """Files of its images, in their order."""
        self.turned = sum(map(_is_turned, self.paths))
        """Number of its images that are turned as their EXIF orientation states."""
        self._images = DecodeAhead(lambda frame: partial(self._read, self.paths[frame]))
        self.stamps = times[keep]
        self.truth = None if truth is None else truth[keep]
        self.camera = self._find_camera(options.camera)

    def image(self, frame: int, following: Sequence[int] = ()) -> Pixels | None:
        """The image of a frame; None (and counted) where it cannot be decoded, is blank or of another size."""
        decode = partial(self._images.image, frame, following)
        return checked_image(decode, str(self.paths[frame]), self.camera, self._drop)

    def digest(self) -> str:
        """sha256 over the tables, the description and every image that is used."""
        whole = hashlib.sha256(repr(self._description).encode())
        for file in [*self._sources, *(file for path in self.paths for file in self._files(path))]:
            whole.update(digest_file(file).encode())
        return whole.hexdigest()

    def _drop(self, kind: str, detail: str) -> None:
        self.drop(kind, f"{self.name}: {detail}")

    def _find(self, pattern: str, kind: Callable[[Path], bool] = Path.is_file) -> Path:
        """The one file, or folder, that a pattern names."""
        pattern = pattern.replace("{which}", self._description.which)
        found = sorted(self._matching(pattern, kind))
        if not found:
            what = "file" if kind is Path.is_file else "folder"
            raise UnreadableRecording(f"{self._folder}: no {what} {pattern} ({self._where} names it)")
        if len(found) > 1:
            names = ", ".join(str(path.relative_to(self._folder)) for path in found)
            raise UnreadableRecording(
                f"{self._folder}: {pattern} fits several files ({names}); type which: LAYOUT:FOLDER:WHICH"
            )
        return found[0]

    def _matching(self, pattern: str, kind: Callable[[Path], bool] = Path.is_file) -> list[Path]:
        """The files in the folder that a pattern names, or the folders."""
        parts = Path(pattern).parts
        if "\0" in pattern or len(pattern) > MAX_PATTERN or pattern.count("*") > MAX_STARS or pattern.count("**") > 1:
            what = f"at most {MAX_PATTERN} characters, {MAX_STARS} stars and one **"
            raise UnreadableRecording(f"{self._where}: the file name {shown(pattern)} is too complicated; {what}")
        if not parts or Path(pattern).is_absolute() or ".." in parts:
            raise UnreadableRecording(f"{self._where}: {shown(pattern)} names no file within the recording's folder")
        try:
            return [path for path in _glob(self._folder, parts) if kind(path)]
        except (OSError, ValueError) as error:
            raise UnreadableRecording(f"{self._folder}: {shown(pattern)} cannot be looked for ({error})") from None

    def _table(self, pattern: str | None, header: bool, delimiter: Delimiter) -> CsvTable | None:
        if pattern is None:
            return None
        path = self._find(pattern)
        self._sources.append(path)
        return read_table(path, header, delimiter)

    def _paths(self, table: CsvTable | None) -> list[Path]:
        frames = self._description.frames
        if table is None:
            pattern = frames.images.replace("{which}", self._description.which)
            matching = self._matching(pattern) if pattern else []
            found = [path for path in matching if not path.name.startswith(".")]  # a trash, or another system's notes
            if not found:
                raise UnreadableRecording(f"{self._folder}: no image fits '{pattern}' (frames.images in {self._where})")
            self._rows = [f"frame {number}" for number in range(len(found))]
            return sorted(found, key=lambda path: by_numbers(path.name))
        if frames.file is None:
            raise UnreadableRecording(f"{self._where}: frames.file is missing: the column with file names")
        base = self._folder if frames.images.startswith("/") else table.path.parent
        base /= frames.images.lstrip("/")
        if "{which}" in frames.images:
            base = self._find(str(base.relative_to(self._folder)), Path.is_dir)
        names = _file_names(table, frames.file)
        self._rows = [f"{table.path.name}, line {line}" for line in table.lines]
        return [
            self._inside(base / self._renamed(name, row, *frames.rename), row)
            for name, row in zip(names, self._rows, strict=True)
        ]

    def _inside(self, path: Path, row: str) -> Path:
        """A path that a table names. Raises `UnreadableRecording` where it leads out of the recording's folder."""
        if not Path(os.path.abspath(path)).is_relative_to(os.path.abspath(self._folder)):
            raise UnreadableRecording(f"{self._folder}: {row}: {shown(str(path))} is not within the recording's folder")
        return path

    def _renamed(self, name: str, row: str, *renames: Rename) -> str:
        try:
            for rename in renames:
                name = rename(name)
        except ValueError as error:
            raise UnreadableRecording(f"{self._folder}: {row}: {error}") from None
        return name

    def _files(self, path: Path) -> list[Path]:
        """A frame's image, and the one that belongs to the right of it."""
        right = self._description.frames.right
        if right is None:
            return [path]
        first = os.path.relpath(path, self._folder)
        second = self._renamed(first, path.name, right)
        if second == first:
            raise UnreadableRecording(f"{self._where}: frames.right finds no {shown(right.replace)} in {shown(first)}")
        return [path, self._inside(self._folder / second, path.name)]

    def _read(self, path: Path) -> Pixels:
        """The image of a frame, of one file or of two side by side."""
        images = [decode_image(read_small(file, MAX_FILE_BYTES)) for file in self._files(path)]
        if len({len(image) for image in images}) > 1:
            raise Undecodable(f"{len(images[0])} rows, but the image beside it has {len(images[1])}")
        return images[0] if len(images) == 1 else np.hstack(images)

    def _times(self, table: CsvTable | None, count: int) -> Stamps:
        frames = self._description.frames
        if table is not None and frames.time is not None:
            return table.nanoseconds(frames.time)
        if frames.period is None:
            raise UnreadableRecording(f"{self._where}: frames need a time column or a period (frames.period: seconds)")
        numbers: Iterable[int] = range(count)
        if table is not None and frames.index is not None:
            numbers = map(_last_number, table.texts(frames.index), self._rows)
        return np.array([round(min(number * frames.period, FAR) * 1e9) for number in numbers], dtype=np.int64)

    def _usable(self, paths: list[Path], times: Stamps, truth: Array | None) -> Ints:
        rows = []
        for row, path in enumerate(paths):
            if times[row] == NO_TIME:
                self._drop("no_time", f"{self._rows[row]}: no time")
            elif missing := [file for file in self._files(path) if not _is_file(file)]:
                self._drop("missing_image", f"{self._rows[row]}: no file {missing[0]}")
            elif truth is not None and not np.isfinite(truth[row]).all():
                what = "heading" if np.isfinite(truth[row, :2]).all() else "position"
                self._drop("no_position", f"{self._rows[row]} ({path.name}): no {what}")
            else:
                rows.append(row)
        kept, repeated, backward = ascending(times[rows].tolist())
        for number in repeated:
            self._drop("duplicate_frame", f"{paths[rows[number]].name} repeats a time")
        for number in backward:
            self._drop("backward_stamp", f"{paths[rows[number]].name} goes back in time")
        apart = lone(times[[rows[number] for number in kept]])
        for number in np.array(kept, dtype=np.int64)[apart]:
            self._drop("lone_stamp", f"{paths[rows[number]].name} was taken hours from all others")
        kept = [number for number, alone in zip(kept, apart, strict=True) if not alone]
        if not kept:
            lost = ", ".join(f"{count} {kind}" for kind, count in sorted(self.dropped.items())) or "there are none"
            first = next(iter(self.details.values()), "")
            raise UnreadableRecording(f"{self._folder}: no frame can be used ({lost}; first: {first})")
        return np.array([rows[number] for number in kept], dtype=np.int64)

    def _find_camera(self, named: str | None) -> Camera:
        described, beside = self._description.camera, self._folder / "camera.yaml"
        if named is None and not isinstance(described, dict) and beside.is_file():
            self._sources.append(beside)
            return read_camera(beside)
        if named is None and isinstance(described, str):
            if described not in camera_models():  # a folder's own description opens no file
                known = ", ".join(sorted(camera_models()))
                raise UnreadableRecording(f"{self._where}: camera: {shown(described)} is no projection: {known}")
            named = described
        if named is not None:
            camera, files = named_camera(named, lambda: self._first_picture().shape[1::-1])
            self._sources += files
            return camera
        first = self._first_picture()
        if not isinstance(described, dict):
            camera, sentence = assumed_camera(self.name, first)
            self.assumed = (*self.assumed, sentence)
            return camera
        return camera_from(described, f"{self._where}: camera", first.shape[1::-1])

    def _first_picture(self) -> Pixels:
        for path in self.paths:
            with suppress(Undecodable, BadInput):
                return self._read(path)
        raise UnreadableRecording(f"{self._folder}: not one of its {len(self.paths)} images can be decoded")


def names_table(paths: Sequence[Path], form: str) -> CsvTable:
    """The values in images' names of a form such as t{time}_x{x}: a row per image, a column per value.

    Raises `UnreadableRecording` for a name of another form.
    """
    texts = re.split(r"\{\w+\}", form)
    rows = []
    for number, path in enumerate(paths, 1):
        first, *middle = texts[:-1]
        rest, end = path.stem, texts[-1]
        fits = rest.isprintable() and len(rest) <= MAX_NAME and rest.startswith(first) and rest.endswith(end)
        rest, values = rest[len(first) : len(rest) - len(end)], []
        for text in middle:
            value, found, rest = rest.partition(text)
            fits = fits and bool(found)
            values.append(value)
        if not fits or "" in (*values, rest):
            named = f"{path.parent}: the image's name {shown(path.name)}"
            raise UnreadableRecording(f"{named} is not of the form {shown(form)}")
        rows.append((number, [*values, rest]))
    return table_of(paths[0].parent, tuple(re.findall(r"\{(\w+)\}", form)), rows)


def _file_names(table: CsvTable, file: str | int) -> list[str]:
    """Names of images: the cells of a column, or made of cells by a form such as {0:010}.png."""
    if isinstance(file, int) or "{" not in file:
        return table.texts(file)
    columns = {
        one[0]: table.texts(int(one[1]) if one[1].isdecimal() else one[1])
        for one in re.finditer(r"\{([^{}:]+)(?::0(\d\d?))?\}", file)
    }
    names = [file] * len(table.lines)
    for placeholder, cells in columns.items():
        width = re.search(r":0(\d+)\}$", placeholder)
        for row, cell in enumerate(cells):
            names[row] = names[row].replace(placeholder, cell.zfill(int(width[1]) if width else 0))
    return names


def _last_number(text: str, row: str) -> int:
    """The last whole number in a cell, but for a suffix (.jp2). Raises `UnreadableRecording` naming the row."""
    numbers = re.findall(r"\d+", re.sub(r"\.[A-Za-z]\w*$", "", text))
    if not numbers or len(numbers[-1]) > MAX_DIGITS:
        what = f"a number of more than {MAX_DIGITS} digits" if numbers else "no number"
        raise UnreadableRecording(f"{row}: {shown(text)} has {what}, expected the image's (frames.index)")
    return int(numbers[-1])


def _glob(folder: Path, parts: Sequence[str]) -> Iterator[Path]:
    """Paths in a folder that a pattern fits, part by part: whatever links lead to a folder, it is looked into once."""
    folders = [folder]
    for part in parts[:-1]:
        below: dict[tuple[int, ...], Path] = {}
        for path in (path for one in folders for path in sorted(one.glob(part)) if path.is_dir()):
            below.setdefault(os.stat(path)[1:3], path)  # its inode and device
        folders = list(below.values())
    return (path for one in folders for path in one.glob(parts[-1]))


def _is_turned(path: Path) -> bool:
    with path.open("rb") as file:
        return orientation_of(file.read(2 * EXIF_BYTES)) in range(2, 9)


def _is_file(path: Path) -> bool:
    """Tells whether there is a file of that name that may be an image; also of a name that no file can have."""
    try:
        return path.is_file() and 0 < path.stat().st_size <= MAX_FILE_BYTES  # as nothing in /proc is
    except OSError:
        return False


class DescribedFolder(Format):
    """A folder of images with CSVs and a description of them."""

    names = "LAYOUT:FOLDER, a description .yaml, or a folder with recording.yaml"

    def opens(self, log: str) -> bool:
        """True where a description is named, or is in the folder."""
        path = user_path(log)
        if path.is_dir():
            return (path / "recording.yaml").is_file()
        return (path.suffix in (".yaml", ".yml") and path.is_file()) or (":" in log and not path.exists())

    def open(self, log: str, options: OpenOptions) -> ImageFolder:
        """`LAYOUT:FOLDER` or `LAYOUT:FOLDER:WHICH`: LAYOUT is a built-in one, one in the options' folders, or a path to
        a .yaml; WHICH replaces `{which}` in its file names. A description alone has a `folder` relative to its file.
        """
        path = user_path(log)
        if path.exists():
            return self._described(log, path / "recording.yaml" if path.is_dir() else path, options)
        layout, _, rest = log.partition(":")
        folder, which = user_path(rest), ""
        if not folder.exists() and ":" in rest:
            rest, _, which = rest.rpartition(":")
            folder = user_path(rest)
        file = find_layout(layout, options.layout_folders)
        description = read_description(file, options.layout_folders)
        if which:
            description = replace(description, which=which)
        return ImageFolder(log, folder, description, str(file), options)

    def _described(self, log: str, file: Path, options: OpenOptions) -> ImageFolder:
        description = read_description(file, options.layout_folders)
        if description.folder is None and file.name != "recording.yaml":
            raise UnreadableRecording(f"{file}: folder is missing; type log={file}:FOLDER, or write folder: … into it")
        folder = file.parent / user_path(description.folder or "")
        inside = Path(os.path.abspath(folder)).is_relative_to(os.path.abspath(file.parent))
        if file.name == "recording.yaml" and not inside:
            raise UnreadableRecording(f"{file}: folder: {shown(description.folder)} is not within its own folder")
        return ImageFolder(log, folder, description, str(file), options)
