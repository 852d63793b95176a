"""Folders of images with CSVs of times and positions, read by a description: everything about them is configuration."""

import hashlib
import re
from collections import Counter
from dataclasses import dataclass, field
from math import pi
from pathlib import Path
from typing import Annotated, Any, Literal

import cv2
import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds
from omninav.pipeline.files import digest_file
from omninav.stages.camera.model import Camera
from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.values.image import Pixels

from .camera_yaml import camera_from, parse_camera
from .messages import Undecodable, decode_picture, is_blank
from .recording import UnreadableRecording
from .tables import Angle, Length, Table, Time, read_table
from .topics import ascending, poses_at

Array = npt.NDArray[np.float64]
Stamps = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Rename:
    """A change to file names on their way from the CSV to the disk: a plain text or a regular expression."""

    replace: str
    by: str
    regex: bool = False

    def __call__(self, name: str) -> str:
        return re.sub(self.replace, self.by, name) if self.regex else name.replace(self.replace, self.by)


@dataclass(frozen=True)
class Frames:
    """Where the pictures are and when they were taken.

    `csv`: a table with one row per picture, its path relative to the recording's folder and with wildcards; without
    one, `images` names the pictures by wildcards, in the order of the numbers in their names. `file`: the column with
    file names, changed by `rename`, then sought in the folder `images` beside the table (or in the recording's folder
    where that starts with '/'). `time`: the column with times; without one, pictures are `period` seconds apart.
    """

    csv: str | None = None
    header: bool = True
    delimiter: str = ","
    file: str | int | None = None
    images: str = ""
    rename: tuple[Rename, ...] = ()
    time: Time | None = None
    period: Annotated[float, Bounds(gt=0)] | None = None


@dataclass(frozen=True)
class Positions:
    """Where the camera was. `csv` null: columns of the frames' own table, row by row.

    A table of its own is joined by time, interpolated linearly: a picture taken at t is looked up at
    t + `clock_offset` (seconds). A picture further than `max_gap` seconds from both neighbours' time, or outside the
    table's time, has no position. `offset_x`, `offset_y` (metres) are added to all positions.
    """

    x: Length
    y: Length
    csv: str | None = None
    header: bool = True
    delimiter: str = ","
    time: Time | None = None
    clock_offset: float = 0.0
    max_gap: Annotated[float, Bounds(gt=0)] = 1.0
    offset_x: float = 0.0
    offset_y: float = 0.0


@dataclass(frozen=True)
class Heading:
    """A column of headings in the positions' table: where it counts from, which way, and what is added (radians)."""

    column: str | int
    unit: Literal["deg", "rad"]
    zero: Literal["x", "y"] = "x"
    sense: Literal["clockwise", "counter_clockwise"] = "counter_clockwise"
    offset: float = 0.0


@dataclass(frozen=True)
class Tangent:
    """Headings from the track itself where nothing measured them.

    The direction in which the track goes, from a straight line fitted to the positions around a moment with Gaussian
    weights of standard deviation `window`, in seconds or in metres of way (`unit`); positions themselves stay as they
    are. `lag` (same unit): the track's direction is looked up that much earlier, as a marker ahead of the wheels turns
    before the robot does.
    """

    window: Annotated[float, Bounds(gt=0)] = 1.0
    unit: Literal["s", "m"] = "s"
    lag: float = 0.0


@dataclass(frozen=True)
class Description:
    """A folder of images, described. `which` fills `{which}` in file names; by default it stands for anything.

    `camera`: what a camera.yaml holds (the image's size may be left out); null: the folder's camera.yaml.
    """

    frames: Frames
    positions: Positions
    folder: str | None = None
    which: str = "*"
    heading: Heading | None = None
    tangent: Tangent = field(default_factory=Tangent)
    camera: dict[str, Any] | None = None


class ImageFolder:
    """A described folder of images as a `Recording`. It has positions (as truth) and no odometry.

    Counted in `dropped`: `missing_image`, `no_position`, `no_time`, `duplicate_frame`, `backward_stamp`, and when
    pictures are read `undecodable_image`, `blank_image`, `wrong_size`.
    Raises `UnreadableRecording` for a file or column that is not there, and where nothing usable remains.
    """

    odometry: None = None

    def __init__(
        self, name: str, folder: Path, description: Description, where: str, camera: Path | None = None
    ) -> None:
        self.name = name
        self.dropped: Counter[str] = Counter()
        self.details: dict[str, str] = {}
        self._folder, self._description, self._where = folder, description, where
        if not folder.is_dir():
            raise UnreadableRecording(f"{folder}: no such folder")
        self._sources: list[Path] = []
        frames = self._table(description.frames.csv, description.frames.header, description.frames.delimiter)
        paths = self._paths(frames)
        times = self._times(frames, len(paths))
        truth = self._poses(frames, times)
        keep = self._usable(paths, times, truth)
        self._paths_kept = [paths[row] for row in keep]
        self.stamps: Stamps = np.array([times[row] for row in keep], dtype=np.int64)
        self.truth: Array | None = truth[keep]
        self.camera = self._find_camera(camera)

    def image(self, frame: int) -> Pixels | None:
        """The picture of a frame; None (and counted) where it cannot be decoded, is blank or of another size."""
        path = self._paths_kept[frame]
        try:
            pixels = decode_picture(path.read_bytes())
        except (Undecodable, OSError) as error:
            self._drop("undecodable_image", f"{path}: {error}")
            return None
        height, width = pixels.shape[:2]
        if (height, width) != (self.camera.height_px, self.camera.width):
            self._drop("wrong_size", f"{path}: {width} x {height}, not {self.camera.width} x {self.camera.height_px}")
            return None
        if is_blank(pixels):
            self._drop("blank_image", f"{path} is blank")
            return None
        return pixels

    def scan(self, frame: int) -> None:
        """A folder of images holds no range readings."""

    def digest(self) -> str:
        """sha256 over the tables, the description and every picture that is used."""
        whole = hashlib.sha256(repr(self._description).encode())
        for path in [*self._sources, *self._paths_kept]:
            whole.update(digest_file(path).encode())
        return whole.hexdigest()

    def _drop(self, kind: str, detail: str) -> None:
        self.dropped[kind] += 1
        self.details.setdefault(kind, f"{self.name}: {detail}")

    def _find(self, pattern: str) -> Path:
        """The one file that a pattern names."""
        pattern = pattern.replace("{which}", self._description.which)
        found = sorted(path for path in self._folder.glob(pattern) if path.is_file())
        if not found:
            raise UnreadableRecording(f"{self._folder}: no file {pattern} ({self._where} asks for it)")
        if len(found) > 1:
            names = ", ".join(str(path.relative_to(self._folder)) for path in found)
            raise UnreadableRecording(
                f"{self._folder}: {pattern} fits several files ({names}); say which: LAYOUT:FOLDER:WHICH"
            )
        return found[0]

    def _table(self, pattern: str | None, header: bool, delimiter: str) -> Table | None:
        if pattern is None:
            return None
        path = self._find(pattern)
        self._sources.append(path)
        return read_table(path, header, delimiter)

    def _paths(self, table: Table | None) -> list[Path]:
        frames = self._description.frames
        if table is None:
            pattern = frames.images.replace("{which}", self._description.which)
            found = [path for path in self._folder.glob(pattern or "*") if path.is_file()]
            if not pattern or not found:
                raise UnreadableRecording(
                    f"{self._folder}: no picture fits '{pattern}' (frames.images in {self._where})"
                )
            return sorted(found, key=lambda path: [int(n) if n.isdigit() else n for n in re.split(r"(\d+)", path.name)])
        if frames.file is None:
            raise UnreadableRecording(f"{self._where}: frames.file is missing: the column with file names")
        base = self._folder if frames.images.startswith("/") else table.path.parent
        base /= frames.images.lstrip("/")
        names = table.texts(frames.file)
        for rename in frames.rename:
            names = [rename(name) for name in names]
        return [base / name for name in names]

    def _times(self, table: Table | None, count: int) -> list[int | None]:
        frames = self._description.frames
        if table is not None and frames.time is not None:
            return table.nanoseconds(frames.time)
        if frames.period is None:
            raise UnreadableRecording(f"{self._where}: frames need a time column or a period (frames.period: seconds)")
        return [round(number * frames.period * 1e9) for number in range(count)]

    def _poses(self, frames: Table | None, times: list[int | None]) -> Array:
        """Poses (N, 3) of all frames, NaN where there is none."""
        positions = self._description.positions
        own = self._table(positions.csv, positions.header, positions.delimiter)
        table = own or frames
        if table is None:
            raise UnreadableRecording(f"{self._where}: positions.csv is missing: the table with positions")
        x = table.numbers(positions.x) + positions.offset_x
        y = table.numbers(positions.y) + positions.offset_y
        if own is None:
            track_times = times
        elif positions.time is None:
            raise UnreadableRecording(f"{self._where}: positions.time is missing: {own.path.name} is joined by time")
        else:
            track_times = own.nanoseconds(positions.time)
        known = [row for row, time in enumerate(track_times) if time is not None and np.isfinite(x[row] + y[row])]
        kept, _, _ = ascending([track_times[row] or 0 for row in known])
        rows = np.array([known[number] for number in kept], dtype=np.int64)
        if len(rows) < 2:
            raise UnreadableRecording(f"{table.path}: fewer than two rows with a position")
        stamps = np.array([track_times[row] for row in rows], dtype=np.int64)
        track = np.column_stack([x[rows], y[rows], self._headings(table, rows, stamps, x[rows], y[rows])])
        poses = np.full((len(times), 3), np.nan)
        if own is None:
            poses[rows] = track
            return poses
        timed = [row for row, time in enumerate(times) if time is not None]
        shifted = np.array([times[row] for row in timed], dtype=np.int64) + round(positions.clock_offset * 1e9)
        sure = np.isfinite(track).all(axis=1)
        if sure.sum() < 2:
            raise UnreadableRecording(f"{table.path}: fewer than two rows with a heading")
        poses[timed] = poses_at(stamps[sure], track[sure], shifted)
        after = np.clip(np.searchsorted(stamps, shifted), 1, len(stamps) - 1)
        gap = np.minimum(np.abs(shifted - stamps[after - 1]), np.abs(stamps[after] - shifted))
        poses[np.array(timed, dtype=np.int64)[gap > positions.max_gap * 1e9]] = np.nan
        return poses

    def _headings(self, table: Table, rows: npt.NDArray[np.int64], stamps: Stamps, x: Array, y: Array) -> Array:
        heading = self._description.heading
        if heading is not None:
            measured = table.numbers(Angle(heading.column, heading.unit))[rows]
            turned = measured if heading.sense == "counter_clockwise" else -measured
            return wrap(turned + (pi / 2 if heading.zero == "y" else 0.0) + heading.offset)
        tangent = self._description.tangent
        along = (stamps - stamps[0]) / 1e9
        if tangent.unit == "m":
            along = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))])
        return track_directions(along, np.column_stack([x, y]), tangent.window, tangent.lag)

    def _usable(self, paths: list[Path], times: list[int | None], truth: Array) -> npt.NDArray[np.int64]:
        rows = []
        for row, path in enumerate(paths):
            if times[row] is None:
                self._drop("no_time", f"frame {row} has no time")
            elif not path.is_file():
                self._drop("missing_image", f"{path} does not exist")
            elif not np.isfinite(truth[row]).all():
                self._drop("no_position", f"frame {row} ({path.name}) has no position")
            else:
                rows.append(row)
        kept, repeated, backward = ascending([times[row] or 0 for row in rows])
        for number in repeated:
            self._drop("duplicate_frame", f"{paths[rows[number]].name} repeats a time")
        for number in backward:
            self._drop("backward_stamp", f"{paths[rows[number]].name} goes back in time")
        if not kept:
            lost = ", ".join(f"{count} {kind}" for kind, count in sorted(self.dropped.items())) or "there are none"
            first = next(iter(self.details.values()), "")
            raise UnreadableRecording(f"{self._folder}: no frame can be used ({lost}; first: {first})")
        return np.array([rows[number] for number in kept], dtype=np.int64)

    def _find_camera(self, named: Path | None) -> Camera:
        beside = self._folder / "camera.yaml"
        path = named or (beside if self._description.camera is None and beside.is_file() else None)
        if path is not None:
            try:
                camera = parse_camera(path.read_bytes(), str(path))
            except OSError as error:
                raise UnreadableRecording(f"{path}: {error.strerror or error}; give camera=PATH/camera.yaml") from None
            self._sources.append(path)
            return camera
        if self._description.camera is None:
            raise UnreadableRecording(f"{self._where}: camera is missing, and {beside} does not exist")
        return camera_from(self._description.camera, f"{self._where}: camera", self._picture_size())

    def _picture_size(self) -> tuple[int, int]:
        for path in self._paths_kept:
            pixels = cv2.imread(str(path), cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)
            if pixels is not None:
                return int(pixels.shape[1]), int(pixels.shape[0])
        raise UnreadableRecording(f"{self._folder}: not one of its {len(self._paths_kept)} pictures can be decoded")


def track_directions(along: Array, positions: Array, window: float, lag: float = 0.0) -> Array:
    """Directions of a track: (N,) radians, counter-clockwise from x.

    `along` (N,): time or way at each of the `positions` (N, 2), never falling. At each point a straight line
    p(s) = p0 + v (s - s0), s0 = `along` - `lag`, is fitted to the positions within four windows with weights
    exp(-((s - s0) / window)^2 / 2); the direction is v's. Where nothing moves within the window, it
    is the last one known.
    """
    directions = np.full(len(along), np.nan)
    centres = np.clip(along - lag, along[0], along[-1])
    low = np.searchsorted(along, centres - 4 * window, side="left")
    high = np.searchsorted(along, centres + 4 * window, side="right")
    for point, centre in enumerate(centres):
        near = slice(min(low[point], len(along) - 2), max(high[point], 2))
        s = along[near] - centre
        weights = np.exp(-0.5 * (s / window) ** 2) + 1e-12
        s = s - (weights @ s) / weights.sum()
        velocity = (weights * s) @ (positions[near] - positions[near].mean(axis=0))
        if np.hypot(*velocity) > 1e-12:
            directions[point] = np.arctan2(velocity[1], velocity[0])
    known = np.flatnonzero(np.isfinite(directions))
    if not len(known):
        return np.zeros(len(along))
    last = np.maximum.accumulate(np.where(np.isfinite(directions), np.arange(len(along)), -1))
    return directions[np.where(last < 0, known[0], last)]


__all__ = ["Description", "Frames", "Heading", "ImageFolder", "Positions", "Rename", "Tangent", "track_directions"]
