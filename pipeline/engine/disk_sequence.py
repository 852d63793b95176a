"""A sequence of values on disk: appended to while the loop runs, read by blocks afterwards, cut back on resume."""

import os
import struct
import zlib
from array import array
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, overload

from omninav.pipeline.files import named, open_itself

from .codec import BadEncoding, decode, encode

_RECORD = struct.Struct("<II")
"""Before each record: its length and its checksum."""
_BLOCK = 1 << 18
"""Bytes that are read at once, and kept: whoever goes through a sequence reads every block once."""


class DiskSequence(Sequence[Any]):
    """Values in the order they came, each record its length, its checksum and its bytes.

    `append` adds one; reading decodes on demand, and holds a block of the file and eight bytes for each record.
    `cut(size)` drops everything behind a byte length that a checkpoint remembers, so that a resumed run goes on exactly
    where the checkpoint stood. `verify` reads all of it.

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
        self._offsets: array[int] | None = None
        self._block, self._block_at = b"", 0

    def flush(self) -> None:
        """Hand what is buffered to the operating system."""
        with named(self.path):
            self._file.flush()

    @property
    def size(self) -> int:
        """Length in bytes, with everything handed to the operating system."""
        self.flush()
        return self._size

    def append(self, value: Any) -> None:
        """Add a value (None stands for an absent one)."""
        content = encode(value)
        with named(self.path):
            self._file.write(_RECORD.pack(len(content), _checksum(self._size, content)))
            self._file.write(content)
        self._size += _RECORD.size + len(content)
        self._offsets = None

    def cut(self, size: int) -> None:
        """Drop all records behind `size` bytes. Raises `BadEncoding` where the file is shorter than that."""
        if self.size < size:
            raise BadEncoding(f"{self.path} is shorter than its checkpoint says ({self.size} < {size} bytes)")
        self._file.truncate(size)
        self._size = size
        self._offsets = None
        self._block = b""

    def verify(self, records: int) -> None:
        """Read it once. Raises `BadEncoding` where a record is damaged, or where there are not as many as stated."""
        for offset in self._index():
            self._content(offset)
        if len(self._index()) != records:
            raise BadEncoding(f"{self.path} has {len(self._index())} records, and there were {records} ticks")

    def close(self) -> None:
        """Close the file; nothing can be appended or read afterwards."""
        self._file.close()

    def present(self) -> "array[int]":
        """The numbers of the values that are not absent; none is decoded."""
        absent = encode(None)
        return array("Q", (n for n, offset in enumerate(self._index()) if self._content(offset) != absent))

    def _bytes(self, at: int, number: int) -> memoryview:
        start = at - self._block_at
        if not 0 <= start <= len(self._block) - number:
            self._block, self._block_at = os.pread(self._file.fileno(), max(number, _BLOCK), at), at
            start = 0
        return memoryview(self._block)[start : start + number]

    def _index(self) -> "array[int]":
        if self._offsets is None:
            end, at = self.size, 0
            offsets = array("Q")
            while at + _RECORD.size <= end:
                length, _ = _RECORD.unpack(self._bytes(at, _RECORD.size))
                offsets.append(at)
                at += _RECORD.size + length
            if at != end:
                raise BadEncoding(f"{self.path} is damaged: it ends inside a record")
            self._offsets = offsets
        return self._offsets

    def __len__(self) -> int:
        return len(self._index())

    def _content(self, offset: int) -> memoryview:
        length, expected = _RECORD.unpack(self._bytes(offset, _RECORD.size))
        content = self._bytes(offset + _RECORD.size, length)
        if _checksum(offset, content) != expected:
            raise BadEncoding(f"{self.path} is damaged: the checksum of the record at byte {offset} does not fit")
        return content

    def _read(self, offset: int) -> Any:
        return decode(self._content(offset))

    @overload
    def __getitem__(self, index: int) -> Any: ...
    @overload
    def __getitem__(self, index: slice) -> list[Any]: ...
    def __getitem__(self, index: int | slice) -> Any:
        if isinstance(index, slice):
            return [self._read(offset) for offset in self._index()[index]]
        return self._read(self._index()[index])

    def __iter__(self) -> Iterator[Any]:
        for offset in self._index()[:]:
            yield self._read(offset)


def _checksum(offset: int, content: bytes | memoryview) -> int:
    return zlib.crc32(content, zlib.crc32(struct.pack("<QQ", offset, len(content))))


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
