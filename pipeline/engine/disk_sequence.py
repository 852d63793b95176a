"""A sequence of values on disk: appended to while the loop runs, read lazily afterwards, cut back on resume."""

import struct
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, overload

from .codec import BadEncoding, decode, encode

_RECORD = struct.Struct("<I")


class DiskSequence(Sequence[Any]):
    """Values in the order they came, each record its length and its bytes.

    `append` adds one; reading decodes on demand. `cut(size)` drops everything behind a byte length that a
    checkpoint remembers, so that a resumed run goes on exactly where the checkpoint stood.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        path.parent.mkdir(parents=True, exist_ok=True)
        self._file = path.open("a+b")
        self._offsets: list[int] | None = None

    def flush(self) -> None:
        """Hand what is buffered to the operating system."""
        self._file.flush()

    @property
    def size(self) -> int:
        """Length in bytes, with everything handed to the operating system."""
        self.flush()
        self._file.seek(0, 2)
        return self._file.tell()

    def append(self, value: Any) -> None:
        """Add a value (None stands for an absent one)."""
        content = encode(value)
        self._file.write(_RECORD.pack(len(content)))
        self._file.write(content)
        self._offsets = None

    def cut(self, size: int) -> None:
        """Drop all records behind `size` bytes. Raises `BadEncoding` where the file is shorter than that."""
        if self.size < size:
            raise BadEncoding(f"{self.path} is shorter than its checkpoint says ({self.size} < {size} bytes)")
        self._file.truncate(size)
        self._offsets = None

    def close(self) -> None:
        """Close the file; nothing can be appended or read afterwards."""
        self._file.close()

    def _index(self) -> list[int]:
        if self._offsets is None:
            end, at = self.size, 0
            offsets = []
            while at < end:
                self._file.seek(at)
                (length,) = _RECORD.unpack(self._file.read(_RECORD.size))
                offsets.append(at)
                at += _RECORD.size + length
            if at != end:
                raise BadEncoding(f"{self.path} ends inside a record")
            self._offsets = offsets
        return self._offsets

    def __len__(self) -> int:
        return len(self._index())

    def _read(self, offset: int) -> Any:
        self._file.seek(offset)
        (length,) = _RECORD.unpack(self._file.read(_RECORD.size))
        return decode(self._file.read(length))

    @overload
    def __getitem__(self, index: int) -> Any: ...
    @overload
    def __getitem__(self, index: slice) -> list[Any]: ...
    def __getitem__(self, index: int | slice) -> Any:
        if isinstance(index, slice):
            return [self._read(offset) for offset in self._index()[index]]
        return self._read(self._index()[index])

    def __iter__(self) -> Iterator[Any]:
        for offset in list(self._index()):
            yield self._read(offset)


class Present(Sequence[Any]):
    """The present values of a sequence on disk, without the gaps."""

    def __init__(self, sequence: DiskSequence) -> None:
        self._sequence = sequence
        self._where = [number for number, value in enumerate(sequence) if value is not None]

    def __len__(self) -> int:
        return len(self._where)

    def __getitem__(self, index: Any) -> Any:
        if isinstance(index, slice):
            return [self._sequence[number] for number in self._where[index]]
        return self._sequence[self._where[index]]
