"""MCAP logs: damaged bytes, and files whose records are damaged while every frame and checksum around them is right."""

import functools
import itertools
import struct
import tempfile
import zlib
from collections.abc import Callable, Sequence
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

import made_logs
import zstandard

from omninav.pipeline.mcap.reader import LogReader
from omninav.stages.recordings.opening import open_recording

from .harness import Format, Wrong, not_finite
from .mutations import BINARY, REALS, SIZES, TEXT, Files, Mutation, on
from .recording_files import read_all

LOG = "log.mcap"
MAGIC = b"\x89MCAP0\r\n"
CHUNK, MESSAGE, ATTACHMENT, FOOTER, DATA_END = 0x06, 0x05, 0x09, 0x02, 0x0F
MAX_PIECES = 5000
"""Of a file that is mutated further."""
_CHUNK_HEAD = struct.Struct("<QQQII")


class Piece(NamedTuple):
    """A record: its opcode and content."""

    opcode: int
    content: bytes


@functools.cache
def samples() -> Sequence[Files]:
    """A short log of every kind of message."""
    with tempfile.TemporaryDirectory() as scratch:
        messages = list(itertools.islice(made_logs.messages(), 126))
        return [{LOG: made_logs.write_mcap(Path(scratch, LOG), iter(messages)).read_bytes()}]


@functools.cache
def _whole() -> tuple[int, int]:
    """Messages and frames of the undamaged log."""
    with tempfile.TemporaryDirectory() as scratch:
        path = Path(scratch, LOG)
        path.write_bytes(samples()[0][LOG])
        return sum(1 for _ in LogReader(path).scan()), len(open_recording(str(path)).stamps)


def read(folder: Path, files: Files) -> Any:
    """Every image, pose and message of a log."""
    recording = open_recording(str(folder / LOG))
    read_all(recording)
    not_finite(recording.odometry, "odometry")
    return dict(recording.dropped)


def read_all_or_count(folder: Path, files: Files) -> Any:
    """As `read`; and what is missing of the undamaged log must have been counted."""
    messages, frames = _whole()
    reader = LogReader(folder / LOG)
    found = sum(1 for _ in reader.scan())
    if found < messages and not reader.dropped:
        raise Wrong(f"{messages - found} of {messages} messages lost in silence")
    recording = open_recording(str(folder / LOG))
    if len(recording.stamps) < frames and not recording.dropped:
        raise Wrong(f"{frames - len(recording.stamps)} of {frames} frames lost in silence")
    return read(folder, files)


def pieces_of(data: bytes) -> list[Piece]:
    """The records of a log, or of a chunk's content, as far as they are whole."""
    at, found = len(MAGIC) if data.startswith(MAGIC) else 0, []
    while at + 9 <= len(data) and len(found) < MAX_PIECES:
        opcode, length = struct.unpack_from("<BQ", data, at)
        if at + 9 + length > len(data):
            break
        found.append(Piece(opcode, data[at + 9 : at + 9 + length]))
        at += 9 + length
    return found


def joined(pieces: Sequence[Piece]) -> bytes:
    """Records one after the other."""
    return b"".join(struct.pack("<BQ", piece.opcode, len(piece.content)) + piece.content for piece in pieces)


def resealed(pieces: Sequence[Piece]) -> bytes:
    """A log of some records, its footer made to fit."""
    ends = [number for number, piece in enumerate(pieces) if piece.opcode == DATA_END]
    if ends and pieces[-1].opcode == FOOTER:
        start = len(MAGIC) + len(joined(pieces[: ends[-1] + 1]))
        pieces = [*pieces[:-1], Piece(FOOTER, struct.pack("<QQI", start, 0, 0))]
        pieces[ends[-1]] = Piece(DATA_END, struct.pack("<I", 0))
    return MAGIC + joined(pieces) + MAGIC


def records(random: Random, files: Files) -> Files:
    """Records left out, repeated, swapped or damaged inside; the frame around them is right."""
    pieces = pieces_of(files[LOG]) or [Piece(0, b"")]
    _rearrange(random, pieces)
    return files | {LOG: resealed(pieces)}


def within_chunk(change: Callable[[Random, list[Piece]], None]) -> Mutation:
    """A mutation of the records in a chunk whose size and checksum are right."""

    def mutate(random: Random, files: Files) -> Files:
        pieces = pieces_of(files[LOG])
        number, inside = _some_chunk(random, pieces)
        if number < 0:
            return files
        change(random, inside)
        pieces[number] = _packed(pieces[number], joined(inside))
        return files | {LOG: resealed(pieces)}

    return mutate


def _hostile_numbers(random: Random, inside: list[Piece]) -> None:
    """Numbers in some messages that no robot says."""
    chosen = [n for n, piece in enumerate(inside) if piece.opcode == MESSAGE and len(piece.content) > 40]
    for at in random.sample(chosen, random.randrange(1, len(chosen) + 1)) if chosen else ():
        content = bytearray(inside[at].content)
        place = 22 + 4 + 4 * random.randrange((len(content) - 26) // 4)
        form = random.choice(("<d", "<I", "<Q"))
        packed = struct.pack(form, random.choice(REALS) if form == "<d" else random.choice(SIZES) % 2**32)
        content[place : place + len(packed)] = packed
        inside[at] = Piece(MESSAGE, bytes(content))


def chunk_head(random: Random, files: Files) -> Files:
    """A chunk that says something else of its size, its checksum or its compression than is so; also zip bombs."""
    pieces = pieces_of(files[LOG])
    number, _ = _some_chunk(random, pieces)
    if number < 0:
        return files
    kind = random.randrange(4)
    content = pieces[number].content
    start, end, size, checksum, named = _CHUNK_HEAD.unpack_from(content)
    if kind == 0:
        size = random.choice(SIZES)
    elif kind == 1:
        checksum = 0
    elif kind == 2:
        pieces[number] = _packed(pieces[number], bytes(random.choice((10**5, 10**7, 4 * 10**8))))
        return files | {LOG: resealed(pieces)}
    else:
        named = random.choice(SIZES) % 2**32
    pieces[number] = Piece(CHUNK, _CHUNK_HEAD.pack(start, end, size, checksum, named) + content[_CHUNK_HEAD.size :])
    return files | {LOG: resealed(pieces)}


def camera(random: Random, files: Files) -> Files:
    """A damaged camera.yaml, its attachment's checksum right."""
    pieces = pieces_of(files[LOG])
    for number, piece in enumerate(pieces):
        at = piece.content.find(made_logs.CAMERA[:11])
        if piece.opcode == ATTACHMENT and at > 8:
            data = random.choice(TEXT)(random, piece.content[at:-4])
            content = piece.content[: at - 8] + struct.pack("<Q", len(data)) + data
            pieces[number] = Piece(ATTACHMENT, content + struct.pack("<I", zlib.crc32(content)))
    return files | {LOG: resealed(pieces)}


def _rearrange(random: Random, pieces: list[Piece]) -> None:
    at, to = random.randrange(len(pieces)), random.randrange(len(pieces))
    kind = random.randrange(4)
    if kind == 0 and len(pieces) > 1:
        del pieces[at]
    elif kind == 1:
        pieces.insert(to, pieces[at])
    elif kind == 2:
        pieces[at], pieces[to] = pieces[to], pieces[at]
    else:
        pieces[at] = Piece(pieces[at].opcode, random.choice(BINARY)(random, pieces[at].content))


def _some_chunk(random: Random, pieces: Sequence[Piece]) -> tuple[int, list[Piece]]:
    """The number of a chunk that can be unpacked, and its records; -1 where there is none."""
    numbers = [number for number, piece in enumerate(pieces) if piece.opcode == CHUNK]
    random.shuffle(numbers)
    for number in numbers:
        try:
            content = pieces[number].content
            (named,) = struct.unpack_from("<I", content, 28)
            data = zstandard.ZstdDecompressor().decompress(content[40 + named :], max_output_size=1 << 20)
            return number, pieces_of(data) or [Piece(0, b"")]
        except (zstandard.ZstdError, struct.error, MemoryError):
            continue
    return -1, []


def _packed(chunk: Piece, data: bytes) -> Piece:
    start, end, *_ = _CHUNK_HEAD.unpack_from(chunk.content)
    packed = zstandard.ZstdCompressor().compress(data)
    head = _CHUNK_HEAD.pack(start, end, len(data), zlib.crc32(data), 4)
    return Piece(CHUNK, head + b"zstd" + struct.pack("<Q", len(packed)) + packed)


IN_CHUNK, IN_MESSAGE = within_chunk(_rearrange), within_chunk(_hostile_numbers)
BYTES = Format("mcap bytes", samples, [on(BINARY)], read_all_or_count)
RECORDS = Format("mcap records", samples, [records, *2 * [IN_CHUNK], *3 * [IN_MESSAGE], chunk_head, camera], read)
