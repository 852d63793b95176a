"""CSV tables whose columns, units and conventions are configuration."""

import csv
import io
import json
import re
from array import array
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from decimal import Decimal, InvalidOperation
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from omninav.pipeline import cut, nearest, read_small
from omninav.stages.geometry.arrays import Array, Bools, Shorts

from .recording import UnreadableRecording
from .stamps import Stamps

PI = Decimal("3.14159265358979323846264338328")
LENGTHS = {"m": Decimal(1), "cm": Decimal("0.01"), "mm": Decimal("0.001"), "km": Decimal(1000), "in": Decimal("0.0254")}
TIMES = {
    name: Decimal(scale) for name, scale in (("ns", 1), ("us", 10**3), ("ms", 10**6), ("s", 10**9), ("min", 60 * 10**9))
}
ANGLES = {"rad": Decimal(1), "deg": PI / 180}
_FAMILIES = (LENGTHS, TIMES, ANGLES)
MAX_TABLE_BYTES = 64_000_000
"""Largest accepted table, bytes."""
MAX_LINES = 1_000_000
"""Lines of a table: poses of three hours at 100 Hz. They take some 200 MB."""
MAX_JSON_BYTES = 4_000_000
"""Largest accepted JSON, bytes; it takes some 40 times as much memory while it is read."""
MAX_ENTRIES = 50_000
"""Entries of a JSON."""
MAX_NUMBERS = 64
"""Numbers in an entry of a JSON: four matrices."""
MAX_ROW = 100_000
"""Characters of a row."""
MAX_CELL = 100
"""Characters of a number in a cell, with its unit; what is longer is no number."""
MAX_EXPONENT = 40
"""Powers of ten of a number in a cell."""
_MAX_MAGNITUDE = {"m": Decimal(10**9), "ns": Decimal(2**62), "rad": Decimal(10**6)}
"""Largest magnitude of a family, by its base unit: a million kilometres, the year 2116 as ROS counts, many turns."""
_PLAIN = {
    **{unit: (rf"^-?\d{{1,{9 + power}}}(\.\d{{0,12}})?$", -power) for unit, power in (("cm", 2), ("mm", 3))},
    **dict.fromkeys(("m", "rad"), (r"^-?\d{1,9}(\.\d{0,18})?([eE][-+]?0?\d)?$", 0)),
    **{
        unit: (rf"^-?([1-3]?\d{{1,{18 - power}}})(\.\d{{0,{power}}})?$", power)
        for unit, power in (("ns", 0), ("us", 3), ("ms", 6), ("s", 9))
    },
}
"""By unit: numbers that few bounds can refuse by their digits, and the power of ten that brings the base unit."""
_BLOCK = 1_000_000
"""Characters and cells that are kept as Python's texts, before they are packed."""
_TOO_LONG = f"a row of more than {MAX_ROW:,} characters; is this a table?"
NO_TIME = np.iinfo(np.int64).min
"""Nanoseconds that mean no time at all."""
Delimiter = Literal[",", ";", "\t", " ", "|", ":"]
_ISO = re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:")
_CELL = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*([^\d\s]*)\s*$")
_SPELLINGS = {
    spelling: unit
    for unit, spellings in {
        "deg": "degrees degree °",
        "rad": "radians radian",
        "s": "sec second seconds",
        "ms": "msec millisecond milliseconds",
        "us": "µs usec microsecond microseconds",
        "ns": "nsec nanosecond nanoseconds",
        "min": "minute minutes",
        "m": "metre metres meter meters",
        "in": '" inch inches',
    }.items()
    for spelling in spellings.split()
}


@dataclass(frozen=True)
class Length:
    """A column of lengths, by its name in the header or its number from 0. A unit inside a cell (`5 cm`) goes first."""

    column: str | int
    unit: Literal["m", "cm", "mm", "km", "in"]


@dataclass(frozen=True)
class Time:
    """A column of times, as `Length`."""

    column: str | int
    unit: Literal["ns", "us", "ms", "s", "min"]


@dataclass(frozen=True)
class Angle:
    """A column of angles, as `Length`."""

    column: str | int
    unit: Literal["rad", "deg"]


class OutOfProportion(UnreadableRecording):
    """A number that is too large for what it means: it may be of another unit."""


class RowBlock(NamedTuple):
    """Some rows in a row: their `cells` one after the other (a `pyarrow.StringArray`), and at which of them each row
    begins, with their number: `starts` (rows + 1,)."""

    cells: Any
    starts: Shorts


@dataclass(frozen=True)
class CsvTable:
    """A CSV file as texts: `names` of its columns (their numbers where there is no header), rows in `blocks`."""

    path: Path
    names: tuple[str, ...]
    blocks: Sequence[RowBlock]
    lines: Shorts
    """The line of the file on which each row ends, from 1: (rows,)."""

    def index(self, column: str | int) -> int:
        """The number of a column. Raises `UnreadableRecording` naming the file, the column and what there is."""
        if isinstance(column, int):
            if not 0 <= column < len(self.names):
                raise UnreadableRecording(f"{self.path}: no column {column}; it has {len(self.names)}, counted from 0")
            return column
        if column not in self.names:
            near = nearest(column, self.names)
            hint = f"did you mean '{near:.60}'? " if near else ""
            between = next((sign for sign in ";\t|" if len(self.names) == 1 and sign in self.names[0]), None)
            if between is not None:
                hint = f"write delimiter: {json.dumps(between)} beside csv: if it divides the columns; "
            known = ", ".join(f"{name:.60}" for name in self.names)
            raise UnreadableRecording(f"{self.path}: no column '{column:.60}'; {hint}columns: {known:.300}")
        return self.names.index(column)

    def texts(self, column: str | int) -> list[str]:
        """The cells of a column without the spaces around them, '' where a row is too short."""
        return [text for part in self._parts(column) for text in part.to_pylist()]

    def numbers(self, column: Length | Angle) -> Array:
        """A column in metres or radians: (rows,), NaN where a cell holds no number."""
        return self._column(column, np.float64, float, float("nan"))

    def nanoseconds(self, column: Time) -> Stamps:
        """A column of times in whole nanoseconds: (rows,), `NO_TIME` where a cell holds no number."""
        return self._column(column, np.int64, lambda value: int(value.to_integral_value()), NO_TIME)

    def _parts(self, column: str | int) -> Iterator[Any]:
        """The cells of a column, block after block, each a `pyarrow.StringArray`."""
        import pyarrow as pa

        number = np.int32(self.index(column))
        for block in self.blocks:
            cells = block.starts[:-1] + number
            inside = cells < block.starts[1:]
            yield block.cells.take(pa.array(cells, mask=None if inside.all() else ~inside)).fill_null("")

    def _column(
        self, column: Length | Time | Angle, kind: type, finish: Callable[[Decimal], float], missing: float
    ) -> npt.NDArray[Any]:
        """Plain numbers are read at once, and what else may be a number one by one: the result is the same."""
        import pyarrow as pa
        import pyarrow.compute as pc

        whole: npt.NDArray[Any] = np.full(len(self.lines), missing, kind)
        first = 0
        for texts in self._parts(column.column):
            found = whole[first : first + len(texts)]
            left = pc.match_substring_regex(texts, r"[0-9]|[^\x00-\x7f]").to_numpy(zero_copy_only=False)
            if column.unit in _PLAIN:
                plain, values = _plain_numbers(texts, column.unit)
                found[plain] = values
                left = left & ~plain
            for row, text in zip(np.flatnonzero(left), texts.filter(pa.array(left)).to_pylist(), strict=True):
                try:
                    value = _in_base_unit(text, column.unit)
                except UnreadableRecording as error:
                    name = self.names[self.index(column.column)]
                    where = f"{self.path}, line {self.lines[first + row]}: column '{name:.60}'"
                    raise type(error)(f"{where}: {error}") from None
                if value is not None:
                    found[row] = finish(value)
            first += len(texts)
        return whole


def read_table(path: Path, header: bool = True, delimiter: Delimiter = ",") -> CsvTable:
    """A CSV file, or a .json of rows by their names. Skips empty lines, and comments (#) where there is no header.

    A .json has no header. Raises `BadInput`.
    """
    if path.suffix == ".json":
        header, rows = False, _json_rows(path)
    else:
        rows = _csv_rows(path, delimiter)
        if not header:
            rows = ((line, row) for line, row in rows if row and not row[0].startswith("#"))
    first = next(((line, row) for line, row in rows if any(map(str.strip, row))), None)
    if first is None:
        raise UnreadableRecording(f"{path}: an empty table")
    if header:
        names = [cell.strip() for cell in first[1]]
        return table_of(path, tuple(names[1:] if names[0] == "#" else names), rows)
    return table_of(path, tuple(map(str, range(len(first[1])))), chain([first], rows))


def table_of(path: Path, names: tuple[str, ...], rows: Iterable[tuple[int, list[str]]]) -> CsvTable:
    """A table of rows with their lines; rows without content, and cells beyond the last name, are left out."""
    import pyarrow as pa

    lines, starts, blocks = array("i"), array("i", [0]), []
    block: list[str] = []
    size = 0
    for line, row in rows:
        cells = [cell.strip() for cell in row[: len(names)]]
        if any(cells) or any(map(str.strip, row[len(names) :])):
            block += cells
            size += sum(map(len, cells))
            lines.append(line)
            starts.append(len(block))
            if len(block) + size > _BLOCK:
                blocks.append(RowBlock(pa.array(block, pa.string()), np.array(starts, np.int32)))
                block, size, starts = [], 0, array("i", [0])
    blocks.append(RowBlock(pa.array(block, pa.string()), np.array(starts, np.int32)))
    return CsvTable(path, names, blocks, np.array(lines, np.int32))


def text_lines(path: Path, newline: str | None = None) -> Iterator[str]:
    """The lines of a table's file, one by one. Raises `BadInput` where it is none, or too long, in all or in a line."""
    content = read_small(path, MAX_TABLE_BYTES)
    if max(content.count(b"\n"), content.count(b"\r")) > MAX_LINES:
        raise UnreadableRecording(f"{path}: more than {MAX_LINES:,} lines; cut it, or leave out every second one")
    file = io.TextIOWrapper(io.BytesIO(content), "utf-8-sig", errors="replace", newline=newline)
    for number, line in enumerate(iter(partial(file.readline, MAX_ROW + 1), ""), 1):
        if len(line) > MAX_ROW:
            raise UnreadableRecording(f"{path}, line {number}: {_TOO_LONG}")
        yield line


def _csv_rows(path: Path, delimiter: Delimiter) -> Iterator[tuple[int, list[str]]]:
    """The rows of a CSV file, and their lines. Raises `BadInput` where a stray quote makes one row of several lines."""
    inside = False

    def lines() -> Iterator[str]:
        nonlocal inside
        for line in text_lines(path, newline=""):
            if inside:
                where = f"{path}, line {reader.line_num}"
                raise UnreadableRecording(f"{where}: a quote is opened and not closed on this line")
            inside = True
            yield line

    reader = csv.reader(lines(), delimiter=delimiter, skipinitialspace=True)
    for row in reader:
        inside = False
        yield reader.line_num, row


def _json_rows(path: Path) -> Iterator[tuple[int, list[str]]]:
    """The entries of a JSON object of numbers in lists, sorted by name: their places, and their names and numbers."""
    entry = ""
    try:
        content = json.loads(read_small(path, MAX_JSON_BYTES))
        if not isinstance(content, dict):
            raise TypeError(f"found a {type(content).__name__}")
        if len(content) > MAX_ENTRIES:
            raise ValueError(f"found {len(content):,} names")
        for number, name in enumerate(sorted(content, key=by_numbers), 1):
            entry = f", {cut(name)}"
            name.encode()
            numbers = np.asarray(content[name], np.float64).ravel()
            if len(numbers) > MAX_NUMBERS:
                raise ValueError(f"found {len(numbers):,} numbers")
            yield number, [name, *map(repr, numbers.tolist())]
    except (ValueError, TypeError, OverflowError, RecursionError) as error:
        limits = f"at most {MAX_ENTRIES:,} names and {MAX_NUMBERS} numbers each"
        raise UnreadableRecording(
            f"{path}{entry}: expected an object of names and matrices of numbers, {limits} ({error!s:.200})"
        ) from None


def unit_named(written: str) -> str:
    """The unit that a spelling means; the spelling itself where it means none."""
    return _SPELLINGS.get(written, written)


def by_numbers(name: str) -> list[str | tuple[int, str]]:
    """A key by which names come in the order of the numbers in them."""
    parts = ((part, part.lstrip("0")) for part in re.split(r"(\d+)", name))
    return [(len(digits), digits) if part.isdecimal() else part for part, digits in parts]


def _plain_numbers(texts: Any, unit: str) -> tuple[Bools, npt.NDArray[Any]]:
    """Which cells are plain numbers, within all bounds, of a unit of `_PLAIN`; and their values in its base unit."""
    import pyarrow as pa
    import pyarrow.compute as pc

    pattern, power = _PLAIN[unit]
    matching = pc.match_substring_regex(texts, pattern)
    cells, chosen = texts.filter(matching), matching.to_numpy(zero_copy_only=False).copy()
    if unit in TIMES:
        whole = pc.replace_substring_regex(cells, r"\..*", "")
        fraction = pc.replace_substring_regex(cells, r"^[^.]*\.?", "")
        values = pc.binary_join_element_wise(whole, pc.utf8_rpad(fraction, power, "0"), "").cast(pa.int64())
        return chosen, values.to_numpy(zero_copy_only=False)
    joined = pc.binary_join_element_wise(cells, f"e{power}", "") if power else cells
    values = joined.cast(pa.float64()).to_numpy(zero_copy_only=False)
    within = np.abs(values) < float(_MAX_MAGNITUDE["rad" if unit == "rad" else "m"])
    chosen[chosen] = within
    return chosen, values[within]


def _moment(text: str) -> Decimal | None:
    """Nanoseconds since 1970 of a date and time by ISO 8601, in UTC where it states no zone; None where it is none."""
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        return None
    since = (moment if moment.tzinfo else moment.replace(tzinfo=UTC)) - datetime(1970, 1, 1, tzinfo=UTC)
    return Decimal(since // timedelta(microseconds=1)) * 1000


def _in_base_unit(text: str, unit: str) -> Decimal | None:
    """The number in a cell in metres, nanoseconds or radians; None where there is none."""
    if len(text) > MAX_CELL:
        return None
    match = _CELL.match(text)
    if match is None and unit in TIMES and _ISO.match(text):
        moment = _moment(text)
        if moment is not None and abs(moment) > _MAX_MAGNITUDE["ns"]:
            raise OutOfProportion(f"{cut(text)} is out of all proportion")
        return moment
    if match is None:
        if text.count(",") == 1 and "." not in text and _CELL.match(pointed := text.replace(",", ".")):
            raise UnreadableRecording(f"{cut(text)} has a decimal comma, expected a point: {pointed}")
        return None
    try:
        number = Decimal(match[1])
    except InvalidOperation:
        return None
    if number and abs(number.adjusted()) > MAX_EXPONENT:
        raise OutOfProportion(f"{cut(text)} is out of all proportion")
    written = unit_named(match[2]) or unit
    family = next(family for family in _FAMILIES if unit in family)
    if written not in family:
        raise UnreadableRecording(f"{cut(text)} is not in {' or '.join(family)}")
    value, base = number * family[written], next(name for name in family if family[name] == 1)
    if abs(value) > _MAX_MAGNITUDE[base]:
        most = float(_MAX_MAGNITUDE[base] / family[written])
        raise OutOfProportion(f"{cut(text)} is out of all proportion, expected at most {most:.2g} {written}")
    return value
