"""Description of a folder of images: found by name, read from YAML, checked."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal

from omninav.pipeline import Bounds, convert, nearest, read_yaml, shown, user_path

from .recording import UnreadableRecording
from .tables import Delimiter, Length, Time

MAX_PATTERN, MAX_REPEATS, MAX_ALTERNATIVES = 200, 2, 4
"""Largest regular expression: characters, repeats (none of a group) and alternatives, with which no name takes it
long."""
MAX_NAME = 255
"""Characters of a file's name, as file systems have it."""
FAR = 1e9
"""Metres or seconds that an offset does not exceed."""
Offset = Annotated[float, Bounds(ge=-FAR, le=FAR)]
_SINGLE = re.compile(r"\\.|\[\^?\]?(?:\\.|[^\]\\])*\]")
"""Pattern of an escaped character or a set of characters in a regular expression."""
_REPEAT = re.compile(r"[*+?][+?]?|\{\d*,\d*\}[+?]?")
_REPEATED_GROUP = re.compile(r"\)\s*[*+?{]")
_MANY_TIMES = re.compile(r"\{\d{3,}|,\d{3,}\}")
Axis = Literal["x", "-x", "y", "-y", "z", "-z"]


@dataclass(frozen=True)
class Rename:
    """A change to file names on their way from the CSV to the disk: a plain text or a regular expression."""

    replace: str
    by: str
    regex: bool = False

    def __post_init__(self) -> None:
        if not 0 < len(self.replace) <= MAX_PATTERN or len(self.by) > MAX_PATTERN:
            raise ValueError(f"'replace' has 1 to {MAX_PATTERN} characters, and 'by' at most as many")
        if self.regex:
            _check_pattern(self.replace, self.by)

    def __call__(self, name: str) -> str:
        """The name changed. Raises ValueError where it is too long to be a file's."""
        if len(Path(name).name) > MAX_NAME or len(name) > 2 * MAX_NAME:
            raise ValueError(f"{shown(name)} has {len(name)} characters, which no file's name has")
        return re.sub(self.replace, self.by, name) if self.regex else name.replace(self.replace, self.by)


def _check_pattern(pattern: str, by: str) -> None:
    """Raise ValueError for a regular expression that is none, or that might take for ever on some name."""
    bare = _SINGLE.sub("c", pattern).replace("(?:", "(")
    if "(?" in bare or _REPEATED_GROUP.search(bare) or _MANY_TIMES.search(bare):
        raise ValueError(f"the regular expression {shown(pattern)} repeats a group; repeat characters or [sets] only")
    if len(_REPEAT.findall(bare)) > MAX_REPEATS or bare.count("|") > MAX_ALTERNATIVES:
        limits = f"at most {MAX_REPEATS} repeats and {MAX_ALTERNATIVES} alternatives"
        raise ValueError(f"the regular expression {shown(pattern)} is too complicated; {limits}, or several renames")
    try:
        nothing = re.match(f"(?:{pattern})|", "")
        assert nothing is not None
        nothing.expand(by)
    except (re.error, IndexError, OverflowError, RecursionError) as error:
        raise ValueError(f"{shown(pattern)} or its replacement {shown(by)} is not understood ({error})") from None


@dataclass(frozen=True)
class Frames:
    """Images and their times.

    `csv`: a table with one row per image, its path relative to the recording's folder and with wildcards; without
    one, `images` names the images by wildcards, in the order of the numbers in their names. `file`: the column with
    file names, changed by `rename`, then sought in the folder `images` beside the table (or in the recording's folder
    where that starts with '/'). `time`: the column with times; without one, images are `period` seconds apart.
    """

    csv: str | None = None
    header: bool = True
    """False: columns have numbers, from 0, and lines that begin with # are comments. A .json has no header, whatever is
    stated here: it maps names, column 0, to rows or matrices of numbers."""
    delimiter: Delimiter = ","
    file: str | int | None = None
    """A column, or a name made of columns: '{0}.png', or '{0:010}.png' for a number with zeros to 10 digits."""
    name: str | None = None
    """Values in the names of the `images`, as in t{time}_x{x}_y{y}, without the suffix: columns named time, x and y."""
    images: str = ""
    rename: tuple[Rename, ...] = ()
    right: Rename | None = None
    """A second image belongs to the right of each one, as of two fisheyes: this makes its path of the first one's."""
    time: Time | None = None
    index: str | int | None = None
    """The column with each image's number, or its name with a number at its end: it counts periods, with gaps."""
    period: Annotated[float, Bounds(ge=1e-6, le=3600)] | None = None

    def __post_init__(self) -> None:
        if self.name is not None:
            parts = re.split(r"\{(\w+)\}", self.name)
            if len(parts) < 3 or len({*parts[1::2]}) < len(parts[1::2]) or "" in parts[2:-1:2]:
                raise ValueError(f"'name' is {shown(self.name)}, expected different {{columns}} with text between them")
            if self.csv is not None:
                raise ValueError("'name' makes a table of the images' names: leave out 'csv'")
        if self.index is not None and (self.time is not None or (self.csv is None and self.name is None)):
            raise ValueError("'index' counts periods in place of a 'time' in a 'csv' or 'name': leave it out (null)")


@dataclass(frozen=True)
class Positions:
    """Positions of the camera. `csv` null: columns of the frames' own table, row by row.

    A table of its own is joined by time, interpolated linearly: an image taken at t is looked up at
    t + `clock_offset` (seconds). An image further than `max_gap` seconds from both neighbours' time, or outside the
    table's time, has no position. `offset_x`, `offset_y` (metres) are added to all positions.
    """

    x: Length
    y: Length
    csv: str | None = None
    header: bool = True
    delimiter: Delimiter = ","
    time: Time | None = None
    clock_offset: Offset = 0.0
    max_gap: Annotated[float, Bounds(gt=0, le=FAR)] = 1.0
    offset_x: Offset = 0.0
    offset_y: Offset = 0.0


@dataclass(frozen=True)
class Heading:
    """Headings measured, in the positions' table: a column of angles, or the columns of a rotation."""

    column: str | int | None = None
    unit: Literal["deg", "rad"] | None = None
    zero: Literal["x", "y"] = "x"
    sense: Literal["clockwise", "counter_clockwise"] = "counter_clockwise"
    rotation: tuple[str | int, ...] = ()
    """Columns of a unit quaternion, in the order x, y, z, w, or the nine of a matrix, row by row. It turns a frame of
    the robot into the world, whose z is up."""
    forward: Axis = "x"
    """The axis of that frame that points ahead of the robot: x of most robots and IMUs, z of a camera."""
    offset: Offset = 0.0
    """Radians, counter-clockwise, that are added."""

    def __post_init__(self) -> None:
        if self.column is not None and self.rotation:
            raise ValueError("has a 'column' and a 'rotation': leave out one (`rotation: []`, `column: null`)")
        if (self.column is None or self.unit is None) and not self.rotation:
            raise ValueError("needs a 'column' and its 'unit', or a 'rotation'")
        if len(self.rotation) not in (0, 4, 9):
            raise ValueError(f"'rotation' has {len(self.rotation)} columns, expected 4 (x, y, z, w) or 9 (a matrix)")


@dataclass(frozen=True)
class Tangent:
    """Headings from the track itself where nothing measured them.

    The direction in which the track goes, from a straight line fitted to the positions around a moment with Gaussian
    weights of standard deviation `window`, in seconds or in metres of way (`unit`); positions themselves stay as they
    are. `lag` (same unit): the track's direction is looked up that much earlier, as a marker ahead of the wheels turns
    before the robot does.
    """

    window: Annotated[float, Bounds(ge=1e-6, le=FAR)] = 1.0
    unit: Literal["s", "m"] = "s"
    lag: Offset = 0.0


@dataclass(frozen=True)
class DataSet:
    """Facts about a public data set, which `omninav data` lists. `like` takes none of them over."""

    what: str
    site: str
    """Address to get it from."""
    run: str
    """Words to type behind `omninav`."""
    published: str = ""
    """Results of others on it, with their source."""


@dataclass(frozen=True)
class Description:
    """A folder of images, described. `which` fills `{which}` in file names; by default it matches anything.

    `positions` null: the images are all there is. `camera`: what a camera.yaml holds (the image's size may be left
    out); null: the folder's camera.yaml; a projection's name: used where there is no camera.yaml.
    """

    frames: Frames
    positions: Positions | None = None
    folder: str | None = None
    which: str = "*"
    heading: Heading | None = None
    tangent: Tangent = field(default_factory=Tangent)
    camera: dict[str, Any] | str | None = None
    about: DataSet | None = field(default=None, repr=False)  # so that words about it do not change a log's digest


def known_layouts(layouts: Sequence[str] = ()) -> dict[str, Path]:
    """Descriptions by name: the built-in ones, then those in further folders, which go first where names are equal."""
    folders = [Path(str(resources.files("omninav.conf"))) / "recording", *(Path(folder) for folder in layouts)]
    return {path.stem: path for folder in folders for path in sorted(folder.glob("*.yaml"))}


def read_description(path: Path, layouts: Sequence[str] = ()) -> Description:
    """A description from a file. Its key `like` names another one, which it changes key by key.

    Raises `BadInput` naming the file and the line or every key that is wrong.
    """
    content = _read(path, layouts, ())
    description, problems = convert(content, Description, "")
    if problems:
        said = "; ".join(f"{p.where.lstrip('.')}: {p.what}" + (f" ({p.hint})" if p.hint else "") for p in problems)
        said = said.replace("'.", "'")
        raise UnreadableRecording(f"{path}: {said:.300}")
    found: Description = description
    return found


def find_layout(name: str, layouts: Sequence[str] = ()) -> Path:
    """The file that describes a layout: its name, or a path. Raises `UnreadableRecording` with the nearest name."""
    known = known_layouts(layouts)
    if name in known:
        return known[name]
    path = user_path(name)
    if path.suffix in (".yaml", ".yml"):
        if path.is_file():
            return path
        raise UnreadableRecording(f"{path}: no such file")
    near = nearest(name, known)
    hint = f"did you mean '{near}'? " if near else ""
    raise UnreadableRecording(f"no layout '{name}'; {hint}layouts: {', '.join(sorted(known))}, or a path to a .yaml")


def _read(path: Path, layouts: Sequence[str], seen: tuple[Path, ...]) -> dict[str, Any]:
    if path in seen:
        raise UnreadableRecording(f"{path}: 'like' leads back to itself")
    content = read_yaml(path)
    if not isinstance(content, dict):
        raise UnreadableRecording(f"{path}: must hold keys (frames, positions, …)")
    like = content.pop("like", None)
    if like is None:
        return content
    return _merged(_read(find_layout(str(like), layouts), layouts, (*seen, path)) | {"about": None}, content)


def _merged(under: dict[str, Any], over: dict[str, Any]) -> dict[str, Any]:
    """Mappings one over the other, key by key."""
    both = dict(under)
    for key, value in over.items():
        nested = isinstance(value, dict) and isinstance(both.get(key), dict)
        both[key] = _merged(both[key], value) if nested else value
    return both
