"""The bytes of an MCAP file: its records, and chunks that are whole, damaged or cut off."""

import struct
import zlib
from collections.abc import Iterator
from io import BytesIO
from typing import Any

import zstandard
from lz4 import frame as lz4
from mcap.data_stream import ReadDataStream

MAGIC = b"\x89MCAP0\r\n"
RECORD_HEAD = struct.Struct("<BQ")
"""A record's opcode and length."""
_CHUNK_HEAD = struct.Struct("<QQQII")
_LENGTH = struct.Struct("<Q")


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

    Raises whatever a damaged chunk makes the decompressors raise, and ValueError for a wrong checksum (with `check`).
    """
    if not whole:
        return _unpack_cut(content)
    _, _, size, checksum, named = _CHUNK_HEAD.unpack_from(content)
    at = _CHUNK_HEAD.size + named
    compression = content[_CHUNK_HEAD.size : at].decode()
    packed = memoryview(content)[at + _LENGTH.size :]
    if len(packed) < _LENGTH.unpack_from(content, at)[0]:
        raise ValueError("it is shorter than it says")
    packed = packed[: _LENGTH.unpack_from(content, at)[0]]
    if compression == "zstd":
        data = zstandard.ZstdDecompressor().decompress(packed, max_output_size=size)
    elif compression == "lz4":
        data = lz4.decompress(packed)  # type: ignore[attr-defined]
    elif compression == "":
        data = bytes(packed)
    else:
        raise ValueError(f"its compression '{compression}' is not known")
    if check and checksum and zlib.crc32(data) != checksum:
        raise ValueError("checksum is wrong")
    return data


def _unpack_cut(content: bytes) -> bytes:
    stream = ReadDataStream(BytesIO(content))
    stream.read(8 + 8 + 8 + 4)  # times, size and checksum of what is not all there
    compression = stream.read_prefixed_string()
    data = content[8 + 8 + 8 + 4 + 4 + len(compression) + 8 :]
    if compression == "zstd":
        return zstandard.ZstdDecompressor().decompressobj().decompress(data)
    if compression == "lz4":
        return bytes(lz4.LZ4FrameDecompressor().decompress(data))  # type: ignore[no-untyped-call]
    return data if compression == "" else b""
