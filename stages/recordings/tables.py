"""CSV tables whose columns, units and conventions are configuration."""

import csv
import io
import re
from array import array
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from itertools import chain
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from omninav.pipeline.graph.problems import cut, nearest
from omninav.pipeline.graph.small_files import read_small

from .recording import UnreadableRecording

Array = npt.NDArray[np.float64]
Stamps = npt.NDArray[np.int64]
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
_PLAIN = {
    **{unit: (rf"^-?\d{{1,{9 + power}}}(\.\d{{0,12}})?$", -power) for unit, power in (("m", 0), ("cm", 2), ("mm", 3))},
    **{
        unit: (rf"^-?([1-3]?\d{{1,{18 - power}}})(\.\d{{0,{power}}})?$", power)
        for unit, power in (("ns", 0), ("us", 3), ("ms", 6), ("s", 9))
    },
    "rad": (r"^-?\d{1,6}(\.\d{0,12})?$", 0),
}
"""By unit: numbers that are within all bounds by their digits, and the power of ten that brings the base unit."""
_BLOCK = 100_000
"""Cells that are kept as Python's texts, before they are packed."""
NO_TIME = np.iinfo(np.int64).min
"""Nanoseconds that stand for no time at all."""
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
    """A CSV file as texts, row after row: `names` of its columns (their numbers where there is no header)."""

    path: Path
    names: tuple[str, ...]
    cells: Any
    """Cells of all rows, one after the other, without the spaces around them: a `pyarrow.StringArray`."""
    starts: npt.NDArray[np.int32]
    """Number of the cell at which each row begins, and how many there are: (rows + 1,)."""
    lines: npt.NDArray[np.int32]
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
            known = ", ".join(f"{name:.60}" for name in self.names)
            raise UnreadableRecording(f"{self.path}: no column '{column:.60}'; {hint}columns: {known:.300}")
        return self.names.index(column)

    def texts(self, column: str | int) -> Any:
        """The cells of a column as a `pyarrow.StringArray`, '' where a row is too short."""
        import pyarrow as pa

        cells = self.starts[:-1] + np.int32(self.index(column))
        inside = cells < self.starts[1:]
        return self.cells.take(pa.array(cells, mask=None if inside.all() else ~inside)).fill_null("")

    def numbers(self, column: Length | Angle) -> Array:
        """A column in metres or radians: (rows,), NaN where a cell holds no number."""
        return self._column(column, np.float64, float, float("nan"))

    def nanoseconds(self, column: Time) -> Stamps:
        """A column of times in whole nanoseconds: (rows,), `NO_TIME` where a cell holds no number."""
        return self._column(column, np.int64, lambda value: int(value.to_integral_value()), NO_TIME)

    def _column(
        self, column: Length | Time | Angle, kind: type, finish: Callable[[Decimal], float], missing: float
    ) -> npt.NDArray[Any]:
        """Plain numbers are read at once, and what else may be a number one by one: the result is the same."""
        import pyarrow as pa
        import pyarrow.compute as pc

        texts = self.texts(column.column)
        found: npt.NDArray[Any] = np.full(len(texts), missing, kind)
        left = pc.match_substring_regex(texts, r"[0-9]|[^\x00-\x7f]").to_numpy(zero_copy_only=False)
        if column.unit in _PLAIN:
            plain, values = _plain_numbers(texts, column.unit)
            found[plain] = values
            left = left & ~plain
        rows = np.flatnonzero(left)
        for row, text in zip(rows, _one_by_one(texts.filter(pa.array(left))), strict=True):
            try:
                value = _in_base_unit(text, column.unit)
            except UnreadableRecording as error:
                where = f"{self.path}, line {self.lines[row]}: column '{column.column}'"
                raise UnreadableRecording(f"{where}: {error}") from None
            if value is not None:
                found[row] = finish(value)
        return found


def read_table(path: Path, header: bool = True, delimiter: Delimiter = ",") -> CsvTable:
    """A CSV file; empty lines are skipped. Raises `BadInput`."""
    reader = csv.reader(text_lines(path, newline=""), delimiter=delimiter, skipinitialspace=True)
    rows = ((reader.line_num, row) for row in reader)
    try:
        first = next(((line, row) for line, row in rows if any(map(str.strip, row))), None)
        if first is None:
            raise UnreadableRecording(f"{path}: an empty table")
        if header:
            return table_of(path, tuple(cell.strip() for cell in first[1]), rows)
        return table_of(path, tuple(map(str, range(len(first[1])))), chain([first], rows))
    except csv.Error as error:
        raise UnreadableRecording(f"{path}, line {reader.line_num}: not readable as CSV ({error})") from None


def table_of(path: Path, names: tuple[str, ...], rows: Iterable[tuple[int, list[str]]]) -> CsvTable:
    """A table of rows with their lines; rows without content, and cells beyond the last name, are left out."""
    import pyarrow as pa

    lines, ends, blocks = array("i"), array("i", [0]), []
    block: list[str] = []
    done = 0
    for line, row in rows:
        cells = [cell.strip() for cell in row]
        if any(cells):
            block += cells[: len(names)]
            lines.append(line)
            ends.append(done + len(block))
            if len(block) > _BLOCK:
                blocks.append(pa.array(block, pa.string()))
                done, block = done + len(block), []
    cells = pa.concat_arrays([*blocks, pa.array(block, pa.string())])
    return CsvTable(path, names, cells, np.array(ends, np.int32), np.array(lines, np.int32))


def text_lines(path: Path, newline: str | None = None) -> Iterator[str]:
    """The lines of a table's file, one by one. Raises `BadInput` where it is none or too long."""
    content = io.BytesIO(read_small(path, MAX_TABLE_BYTES))
    return io.TextIOWrapper(content, "utf-8-sig", errors="replace", newline=newline)


def _one_by_one(texts: Any) -> Iterator[str]:
    for start in range(0, len(texts), _BLOCK):
        yield from texts.slice(start, _BLOCK).to_pylist()


def _plain_numbers(texts: Any, unit: str) -> tuple[npt.NDArray[np.bool_], npt.NDArray[Any]]:
    """Which cells are plain numbers, within all bounds, of a unit of `_PLAIN`; and their values in its base unit."""
    import pyarrow as pa
    import pyarrow.compute as pc

    pattern, power = _PLAIN[unit]
    chosen = pc.match_substring_regex(texts, pattern)
    cells = texts.filter(chosen)
    if unit in _TIMES:
        whole = pc.replace_substring_regex(cells, r"\..*", "")
        fraction = pc.replace_substring_regex(cells, r"^[^.]*\.?", "")
        values = pc.binary_join_element_wise(whole, pc.utf8_rpad(fraction, power, "0"), "").cast(pa.int64())
    else:
        values = pc.binary_join_element_wise(cells, f"e{power}", "").cast(pa.float64())
    return chosen.to_numpy(zero_copy_only=False), values.to_numpy(zero_copy_only=False)


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
