"""Arrays that only grow, beside a checkpoint: each row is written once, however many checkpoints there are."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from omninav.pipeline.graph.value import Value

from .codec import BadEncoding
from .disk_sequence import DiskSequence

_STEP = 1 << 22
"""Bytes of rows in a record, about."""


@dataclasses.dataclass
class _Written:
    """Written part of a value: rows by field. Another value in its place is another generation, of new files:
    the last checkpoint knows the old ones until the next is there."""

    value: Value | None = None
    generation: int = 0
    rows: dict[str, int] = dataclasses.field(default_factory=dict)


class GrownRows:
    """The rows of values whose class names fields that grow (`Value.grows`), each field's in a file of its own.

    `write` adds the rows that are new; `read` cuts a file back to what a checkpoint knows and gives all rows.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._files: dict[str, DiskSequence] = {}
        self._written: dict[str, _Written] = {}

    def write(self, name: str, value: Any) -> tuple[Any, dict[str, Any]]:
        """The value without its rows, and where they are: the generation, and the sizes of the fields' files."""
        known = self._written.get(name, _Written())
        if known.value is not value:
            known = self._written[name] = _Written(value, known.generation + 1)
            for field in value.grows:
                self._path(name, field, known.generation - 2).unlink(missing_ok=True)
        sizes = {}
        for field in value.grows:
            rows, file = getattr(value, field), self._file(name, field, known.generation)
            if field not in known.rows:
                file.cut(0)
            step = max(1, _STEP * len(rows) // max(rows.nbytes, 1))
            for start in range(known.rows.get(field, 0), len(rows), step):
                file.append(np.asarray(rows[start : start + step]))
            sizes[field], known.rows[field] = file.size, len(rows)
        empty = {field: getattr(value, field)[:0] for field in value.grows}
        return dataclasses.replace(value, **empty), {"generation": known.generation, "sizes": sizes}

    def read(self, name: str, value: Any, where: Mapping[str, Any]) -> None:
        """Put the rows back into a value that was written.

        Raises `BadEncoding` where a file is damaged, or shorter than it was.
        """
        generation, sizes = int(where["generation"]), where["sizes"]
        if "/" in name or set(sizes) != set(value.grows):
            raise BadEncoding(f"{name}: no rows of a {type(value).__name__}")
        for field, size in sizes.items():
            file = self._file(name, field, generation)
            file.cut(size)
            setattr(value, field, np.concatenate([getattr(value, field), *file]))
        self._written[name] = _Written(value, generation, {field: len(getattr(value, field)) for field in sizes})

    def close(self) -> None:
        """Close the files."""
        for file in self._files.values():
            file.close()

    def _path(self, name: str, field: str, generation: int) -> Path:
        return self._folder / f"{name}.{field}.{generation}.rows"

    def _file(self, name: str, field: str, generation: int) -> DiskSequence:
        path = self._path(name, field, generation)
        if path.name not in self._files:
            self._files[path.name] = DiskSequence(path)
        return self._files[path.name]


def grows(value: Any) -> bool:
    """Tells whether a value has fields of which only new rows need be written."""
    return isinstance(value, Value) and bool(value.grows)
