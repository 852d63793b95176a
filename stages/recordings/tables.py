"""CSV tables whose columns, units and conventions are configuration."""

import csv
import io
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import Literal, TypeVar

import numpy as np
import numpy.typing as npt

from omninav.pipeline.graph.problems import cut, nearest
from omninav.pipeline.graph.small_files import read_small

from .recording import UnreadableRecording

Array = npt.NDArray[np.float64]

T = TypeVar("T")
PI = Decimal("3.14159265358979323846264338328")
_LENGTHS = {"m": Decimal(1), "cm": Decimal("0.01"), "mm": Decimal("0.001"), "in": Decimal("0.0254")}
_TIMES = {
    name: Decimal(scale) for name, scale in (("ns", 1), ("us", 10**3), ("ms", 10**6), ("s", 10**9), ("min", 60 * 10**9))
}
_ANGLES = {"rad": Decimal(1), "deg": PI / 180}
_FAMILIES = (_LENGTHS, _TIMES, _ANGLES)
MAX_TABLE_BYTES = 64_000_000
"""Of a table: a million rows and more."""
MAX_CELL = 100
"""Characters of a number in a cell, with its unit; what is longer is no number."""
MAX_EXPONENT = 40
"""Powers of ten of a number in a cell."""
_MAX_MAGNITUDE = {"m": Decimal(10**9), "ns": Decimal(2**62), "rad": Decimal(10**6)}
"""Of a family, by its base unit: a million kilometres, the year 2116 as ROS counts, many turns."""
Delimiter = Literal[",", ";", "\t", " ", "|", ":"]
_CELL = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*([^\d\s]*)\s*$")
_SPELLINGS = {
    "degrees": "deg",
    "degree": "deg",
    "°": "deg",
    "radians": "rad",
    "sec": "s",
    "seconds": "s",
    '"': "in",
    "inch": "in",
}


@dataclass(frozen=True)
class Length:
    """A column of lengths, by its name in the header or its number from 0. A unit inside a cell (`5 cm`) goes first."""

    column: str | int
    unit: Literal["m", "cm", "mm", "in"]


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


@dataclass(frozen=True)
class CsvTable:
    """A CSV file as texts: `names` of the columns (their numbers where there is no header), `rows`, and their lines."""

    path: Path
    names: tuple[str, ...]
    rows: list[list[str]]
    lines: list[int]
    """The line of the file on which each row ends, from 1."""

    def index(self, column: str | int) -> int:
        """The number of a column. Raises `UnreadableRecording` naming the file, the column and what there is."""
        if isinstance(column, int):
            if not 0 <= column < len(self.names):
                raise UnreadableRecording(f"{self.path}: no column {column}; it has {len(self.names)}, counted from 0")
            return column
        if column not in self.names:
            near = nearest(column, self.names)
            hint = f"did you mean '{near:.60}'? " if near else ""
            known = ", ".join(f"{name:.60}" for name in self.names)
            raise UnreadableRecording(f"{self.path}: no column '{column:.60}'; {hint}columns: {known:.300}")
        return self.names.index(column)

    def texts(self, column: str | int) -> list[str]:
        """The cells of a column, '' where a row is too short."""
        number = self.index(column)
        return [row[number].strip() if number < len(row) else "" for row in self.rows]

    def numbers(self, column: Length | Angle) -> Array:
        """A column in metres or radians: (rows,), NaN where a cell holds no number."""
        return np.array(list(self._cells(column, float, float("nan"))))

    def nanoseconds(self, column: Time) -> list[int | None]:
        """A column of times in whole nanoseconds, None where a cell holds no number."""
        return list(self._cells(column, lambda value: int(value.to_integral_value()), None))

    def _cells(self, column: Length | Time | Angle, finish: Callable[[Decimal], T], missing: T) -> Iterator[T]:
        for line, text in zip(self.lines, self.texts(column.column), strict=True):
            try:
                value = _in_base_unit(text, column.unit)
            except UnreadableRecording as error:
                raise UnreadableRecording(f"{self.path}, line {line}: column '{column.column}': {error}") from None
            yield missing if value is None else finish(value)


def read_table(path: Path, header: bool = True, delimiter: Delimiter = ",") -> CsvTable:
    """A CSV file; empty lines are skipped. Raises `BadInput`."""
    text = io.StringIO(read_small(path, MAX_TABLE_BYTES).decode("utf-8-sig", errors="replace"), newline="")
    reader = csv.reader(text, delimiter=delimiter, skipinitialspace=True)
    rows, lines = [], []
    try:
        for row in reader:
            if any(cell.strip() for cell in row):
                rows.append(row)
                lines.append(reader.line_num)
    except csv.Error as error:
        raise UnreadableRecording(f"{path}, line {reader.line_num}: not readable as CSV ({error})") from None
    if not rows:
        raise UnreadableRecording(f"{path}: an empty table")
    if header:
        return CsvTable(path, tuple(cell.strip() for cell in rows[0]), rows[1:], lines[1:])
    return CsvTable(path, tuple(str(number) for number in range(len(rows[0]))), rows, lines)


def _in_base_unit(text: str, unit: str) -> Decimal | None:
    """The number in a cell in metres, nanoseconds or radians; None where there is none."""
    match = _CELL.match(text) if len(text) <= MAX_CELL else None
    if match is None:
        return None
    try:
        number = Decimal(match[1])
    except InvalidOperation:
        return None
    if number and abs(number.adjusted()) > MAX_EXPONENT:
        raise UnreadableRecording(f"{cut(text)} is out of all proportion")
    written = _SPELLINGS.get(match[2], match[2]) or unit
    family = next(family for family in _FAMILIES if unit in family)
    if written not in family:
        raise UnreadableRecording(f"{cut(text)} is not in {' or '.join(family)}")
    value, base = number * family[written], next(name for name in family if family[name] == 1)
    if abs(value) > _MAX_MAGNITUDE[base]:
        raise UnreadableRecording(
            f"{cut(text)} is out of all proportion, expected at most {_MAX_MAGNITUDE[base]:.0e} {base}"
        )
    return value
