"""CSV tables whose columns, units and conventions are configuration."""

import csv
import re
from collections.abc import Callable
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import Literal, TypeVar

import numpy as np
import numpy.typing as npt

from omninav.pipeline.graph.problems import nearest

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
    """A CSV file as texts: `names` of the columns (their numbers where there is no header) and `rows`."""

    path: Path
    names: tuple[str, ...]
    rows: list[list[str]]

    def index(self, column: str | int) -> int:
        """The number of a column. Raises `UnreadableRecording` naming the file, the column and what there is."""
        if isinstance(column, int):
            if not 0 <= column < len(self.names):
                raise UnreadableRecording(f"{self.path}: no column {column}; it has {len(self.names)}, counted from 0")
            return column
        if column not in self.names:
            near = nearest(column, self.names)
            hint = f"did you mean '{near}'? " if near else ""
            raise UnreadableRecording(f"{self.path}: no column '{column}'; {hint}columns: {', '.join(self.names)}")
        return self.names.index(column)

    def texts(self, column: str | int) -> list[str]:
        """The cells of a column, '' where a row is too short."""
        number = self.index(column)
        return [row[number].strip() if number < len(row) else "" for row in self.rows]

    def numbers(self, column: Length | Angle) -> Array:
        """A column in metres or radians: (rows,), NaN where a cell holds no number."""
        return np.array([self._cell(text, column, float, float("nan")) for text in self.texts(column.column)])

    def nanoseconds(self, column: Time) -> list[int | None]:
        """A column of times in whole nanoseconds, None where a cell holds no number."""
        return [
            self._cell(text, column, lambda value: int(value.to_integral_value()), None)
            for text in self.texts(column.column)
        ]

    def _cell(self, text: str, column: Length | Time | Angle, finish: Callable[[Decimal], T], missing: T) -> T:
        try:
            value = _in_base_unit(text, column.unit)
        except UnreadableRecording as error:
            raise UnreadableRecording(f"{self.path}: column '{column.column}': {error}") from None
        return missing if value is None else finish(value)


def read_table(path: Path, header: bool = True, delimiter: str = ",") -> CsvTable:
    """A CSV file; empty lines are skipped. Raises `UnreadableRecording`."""
    try:
        with path.open(newline="", encoding="utf-8-sig", errors="replace") as file:
            rows = [
                row
                for row in csv.reader(file, delimiter=delimiter, skipinitialspace=True)
                if any(c.strip() for c in row)
            ]
    except OSError as error:
        raise UnreadableRecording(f"{path}: {error.strerror or error}") from None
    except csv.Error as error:
        raise UnreadableRecording(f"{path}: not readable as CSV ({error})") from None
    if not rows:
        raise UnreadableRecording(f"{path}: an empty table")
    if header:
        return CsvTable(path, tuple(cell.strip() for cell in rows[0]), rows[1:])
    return CsvTable(path, tuple(str(number) for number in range(len(rows[0]))), rows)


def _in_base_unit(text: str, unit: str) -> Decimal | None:
    """The number in a cell in metres, nanoseconds or radians; None where there is none."""
    match = _CELL.match(text)
    if match is None:
        return None
    try:
        number = Decimal(match[1])
    except InvalidOperation:
        return None
    written = _SPELLINGS.get(match[2], match[2]) or unit
    family = next(family for family in _FAMILIES if unit in family)
    if written not in family:
        raise UnreadableRecording(f"'{text}' is not in {' or '.join(family)}")
    return number * family[written]
