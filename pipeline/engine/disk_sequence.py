"""A sequence of values on disk: appended to while the loop runs, read by blocks afterwards, cut back on resume."""

import os
import struct
import zlib
from array import array
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, overload

from omninav.pipeline.files import named, open_itself

from .codec import BadEncoding, decode_all, encode_all

_RECORD = struct.Struct("<IIIQ")
"""Before each record: its length, its checksum, the number of its values, and a bit for each that is present."""
_MOST_VALUES = 64
"""Values that are encoded together at most: one bit each."""
_MOST_BYTES = 1 << 20
"""Bytes of a record, about; a larger value is a record by itself."""
_BLOCK = 1 << 18
"""Bytes that are read at once, and kept: a loop over a sequence reads every block once."""


class DiskSequence(Sequence[Any]):
    """Values in the order they came, some at a time in a record: its length, its checksum, and their bytes.

    `append` adds one; it is encoded with those after it, at the latest when `size` or a value is read.
    Reading decodes on demand, and holds a block of the file, the values of one record, and 16 bytes for each record.
    `cut(size)` drops everything behind a byte length that a checkpoint remembers, so that a resumed run continues
    exactly where the checkpoint was. `verify` reads all of it.

    The checksum is CRC-32 over the record's place, its length and its bytes: it finds every flipped bit and every burst
    of up to 32 bits with certainty, and costs less than a cryptographic hash, which would protect from no one here.
    """

    def __init__(self, path: Path, append: bool = True) -> None:
        """Opens a sequence. With `append` the file is made where it does not exist; without, it is only read."""
        self.path = path
        if append:
            path.parent.mkdir(parents=True, exist_ok=True)
        flags = os.O_RDWR | os.O_CREAT | os.O_APPEND if append else os.O_RDONLY
        self._file = os.fdopen(open_itself(path, flags), "a+b" if append else "rb")
        self._size = self._file.seek(0, os.SEEK_END)
        self._coming: list[Any] = []
        self._together = 1
        self._records: tuple[array[int], array[int]] | None = None
        self._block, self._block_at = b"", 0
        self._decoded: tuple[int, list[Any]] = (-1, [])

    def flush(self) -> None:
        """Hand what was appended to the operating system."""
        if self._coming:
            self._write()
        with named(self.path):
            self._file.flush()

    @property
    def size(self) -> int:
        """Length in bytes, with everything handed to the operating system."""
        self.flush()
        return self._size

    def append(self, value: Any) -> None:
        """Add a value (None for an absent one)."""
        self._coming.append(value)
        if len(self._coming) >= self._together:
            self._write()

    def _write(self) -> None:
        values, self._coming = self._coming, []
        content = encode_all([value for value in values if value is not None])
        there = sum(1 << n for n, value in enumerate(values) if value is not None)
        rest = struct.pack("<IQ", len(values), there)
        with named(self.path):
            self._file.write(_RECORD.pack(len(content), _checksum(self._size, rest, content), len(values), there))
            self._file.write(content)
        self._size += _RECORD.size + len(content)
        if there:  # how large they are is known
            self._together = max(1, min(_MOST_VALUES, _MOST_BYTES * there.bit_count() // len(content)))
        self._records = None

    def cut(self, size: int) -> None:
        """Drop all records behind `size` bytes. Raises `BadEncoding` where the file is shorter than that."""
        if self.size < size:
            raise BadEncoding(f"{self.path} is shorter than its checkpoint states ({self.size} < {size} bytes)")
        self._file.truncate(size)
        self._size = size
        self._records = None
        self._block = b""
        self._decoded = (-1, [])

    def verify(self, values: int) -> None:
        """Read it once. Raises `BadEncoding` where a record is damaged, or where it has not as many values."""
        for offset in self._index()[0]:
            self._content(offset)
        if len(self) != values:
            raise BadEncoding(f"{self.path} has {len(self)} values, and there were {values} ticks")

    def close(self) -> None:
        """Close the file; nothing can be appended or read afterwards."""
        self.flush()
        self._file.close()

    def present(self) -> "array[int]":
        """The numbers of the values that are not absent; none is decoded."""
        found = array("Q")
        first = 0
        for offset, end in zip(*self._index(), strict=True):
            there = self._head(offset)[3]
            found.extend(first + n for n in range(end - first) if there >> n & 1)
            first = end
        return found

    def _bytes(self, at: int, number: int) -> memoryview:
        start = at - self._block_at
        if not 0 <= start <= len(self._block) - number:
            self._block, self._block_at = os.pread(self._file.fileno(), max(number, _BLOCK), at), at
            start = 0
        return memoryview(self._block)[start : start + number]

    def _head(self, offset: int) -> tuple[int, int, int, int]:
        length, checksum, number, there = _RECORD.unpack(self._bytes(offset, _RECORD.size))
        return length, checksum, number, there

    def _index(self) -> tuple["array[int]", "array[int]"]:
        """Offsets of the records, and for each the number of values up to its end."""
        if self._coming or self._records is None:
            end, at, number = self.size, 0, 0
            offsets, ends = array("Q"), array("Q")
            while at + _RECORD.size <= end:
                length, _, values, _ = self._head(at)
                offsets.append(at)
                number += values
                ends.append(number)
                at += _RECORD.size + length
            if at != end:
                raise BadEncoding(f"{self.path} is damaged: it ends inside a record")
            self._records = offsets, ends
        return self._records

    def __len__(self) -> int:
        ends = self._index()[1]
        return ends[-1] if ends else 0

    def _content(self, offset: int) -> memoryview:
        length, expected, number, there = self._head(offset)
        content = self._bytes(offset + _RECORD.size, length)
        if _checksum(offset, struct.pack("<IQ", number, there), content) != expected:
            raise BadEncoding(f"{self.path} is damaged: the checksum of the record at byte {offset} does not fit")
        return content

    def _values(self, record: int) -> list[Any]:
        if self._decoded[0] != record:
            offset = self._index()[0][record]
            content = self._content(offset)
            _, _, number, there = self._head(offset)
            present = iter(decode_all(content, there.bit_count()))
            self._decoded = record, [next(present) if there >> n & 1 else None for n in range(number)]
        return self._decoded[1]

    @overload
    def __getitem__(self, index: int) -> Any: ...
    @overload
    def __getitem__(self, index: slice) -> list[Any]: ...
    def __getitem__(self, index: int | slice) -> Any:
        if isinstance(index, slice):
            return [self[number] for number in range(len(self))[index]]
        number = range(len(self))[index]
        ends = self._index()[1]
        record = bisect_right(ends, number)
        return self._values(record)[number - (ends[record - 1] if record else 0)]

    def __iter__(self) -> Iterator[Any]:
        for record in range(len(self._index()[0])):
            yield from self._values(record)


def _checksum(offset: int, head: bytes, content: bytes | memoryview) -> int:
    return zlib.crc32(content, zlib.crc32(struct.pack("<QQ", offset, len(content)) + head))


class Present(Sequence[Any]):
    """The present values of a sequence on disk, without the gaps."""

    def __init__(self, sequence: DiskSequence) -> None:
        self._sequence = sequence
        self._where = sequence.present()

    def __len__(self) -> int:
        return len(self._where)

    def __getitem__(self, index: Any) -> Any:
        if isinstance(index, slice):
            return [self._sequence[number] for number in self._where[index]]
        return self._sequence[self._where[index]]
