"""The bytes of an MCAP file: its records, and chunks that are whole, damaged or cut off."""

import struct
import zlib
from collections.abc import Callable, Iterator
from io import BytesIO
from typing import Any, NamedTuple

import zstandard
from lz4 import frame as lz4
from mcap.data_stream import ReadDataStream

MAGIC = b"\x89MCAP0\r\n"
RECORD_HEAD = struct.Struct("<BQ")
"""A record's opcode and length."""
_CHUNK_HEAD = struct.Struct("<QQQII")
_LENGTH = struct.Struct("<Q")
MAX_BYTES = 1 << 27
"""Largest record and largest unpacked chunk, bytes: a raw frame of 40 megapixels in colour fits."""
MAX_RATIO = 256
"""Largest ratio of unpacked to packed length of a chunk of more than 4 MB."""


MAX_BYTES_IN_ALL, MAX_RATIO_IN_ALL = 1 << 26, 128
"""Bounds of what is unpacked of a file: in bytes, and as a multiple of the file's own."""
MAX_MESSAGES, BYTES_PER_MESSAGE = 100_000, 8
"""A file holds at most so many messages, and one more for each so many of its bytes: packed as well as can be, a real
message takes more."""


class Allowance:
    """Bytes that may still be read of a log, by the size of its file."""

    def __init__(self, size: int) -> None:
        self._bytes = MAX_BYTES_IN_ALL + MAX_RATIO_IN_ALL * size
        self._messages = MAX_MESSAGES + size // BYTES_PER_MESSAGE
        self._stated = f"more than a log of {size:,} bytes holds"

    def unpack(self, number: int) -> None:
        """Take off some bytes. Raises ValueError where there are too many."""
        self._bytes -= number
        if self._bytes < 0:
            raise ValueError(f"all that was unpacked so far is {self._stated}")

    def read_message(self) -> None:
        """Take off a message. Raises ValueError where there are too many."""
        self._messages -= 1
        if self._messages < 0:
            raise ValueError(f"these are more messages than {self._stated.removeprefix('more than ')}")


class Place(NamedTuple):
    """Position of a record in its file, with its head: first byte and length."""

    start: int
    length: int

    @property
    def end(self) -> int:
        """The first byte behind it."""
        return self.start + self.length


def records_in(data: bytes) -> Iterator[tuple[int, int, int]]:
    """Records in a run of bytes: opcode, first byte of the content, end. Stops before one that is not whole."""
    at = 0
    while at + RECORD_HEAD.size <= len(data):
        opcode, length = RECORD_HEAD.unpack_from(data, at)
        start = at + RECORD_HEAD.size
        at = start + length
        if at > len(data):
            return
        yield opcode, start, at


def parse(kind: Any, content: bytes) -> Any:
    """A record's content as the class of the mcap library."""
    return kind.read(ReadDataStream(BytesIO(content)))


def unpack(content: bytes, whole: bool, check: bool = True) -> bytes:
    """The records in a chunk. A chunk that was cut off gives what its compression has let through so far.

    Raises whatever a damaged chunk makes the decompressors raise, and ValueError for a wrong checksum (with `check`)
    and for sizes that no log has: they are refused before anything is unpacked.
    """
    _, _, size, checksum, named = _CHUNK_HEAD.unpack_from(content)
    at = _CHUNK_HEAD.size + named
    compression = content[_CHUNK_HEAD.size : at].decode()
    packed = memoryview(content)[at + _LENGTH.size :]
    limit = min(MAX_BYTES, max(MAX_BYTES // 32, MAX_RATIO * len(content)))
    if whole and size > limit:
        raise ValueError(f"it states that its {len(packed)} bytes unpack to {size}")
    if whole and len(packed) < _LENGTH.unpack_from(content, at)[0]:
        raise ValueError("it is shorter than it states")
    data = _UNPACK[compression](packed[: _LENGTH.unpack_from(content, at)[0]], min(size, limit))
    if whole and len(data) != size:
        raise ValueError("it is not as long as it states")
    if whole and check and checksum and zlib.crc32(data) != checksum:
        raise ValueError("checksum is wrong")
    return data


def unpack_zstd(packed: memoryview | bytes, size: int) -> bytes:
    """Unpacks at most one byte more than `size`, so that more is noticed."""
    with zstandard.ZstdDecompressor(max_window_size=MAX_BYTES).stream_reader(packed) as stream:
        return stream.read(size + 1)


def unpack_lz4(packed: memoryview | bytes, size: int) -> bytes:
    """Unpacks at most one byte more than `size`, so that more is noticed."""
    return bytes(lz4.LZ4FrameDecompressor().decompress(bytes(packed), max_length=size + 1))  # type: ignore[no-untyped-call]


_UNPACK: dict[str, Callable[[memoryview, int], bytes]] = {
    "zstd": unpack_zstd,
    "lz4": unpack_lz4,
    "": lambda packed, size: bytes(packed[: size + 1]),
}
"""By compression: up to one byte more than the given size."""
