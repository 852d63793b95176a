"""Summary at the end of an MCAP file: its channels, its chunks, and how many messages it holds."""

import os
import zlib
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

from mcap.opcode import Opcode
from mcap.records import AttachmentIndex, ChunkIndex, DataEnd, Footer, Statistics

from .chunks import MAGIC, MAX_BYTES, RECORD_HEAD, Place, parse, records_in

_FOOTER_SIZE = RECORD_HEAD.size + 20 + len(MAGIC)
_DATA_END_SIZE = RECORD_HEAD.size + 4


@dataclass(frozen=True)
class Summary:
    """The end of a file, as far as it is there and sound.

    `damage`: why it cannot be used, "" where it can. `descriptions`: opcode and content of every schema and channel.
    `chunks` and `attachments`: where these records are, in the file's order. `counts`: how many messages each channel
    has; None: not stated. `checksum`: of all before it; 0: not stated.
    """

    damage: str = ""
    descriptions: list[tuple[int, bytes]] = field(default_factory=list)
    chunks: list[Place] = field(default_factory=list)
    attachments: list[Place] = field(default_factory=list)
    counts: dict[int, int] | None = None
    checksum: int = 0


def read_summary(file: Any, size: int, start: int = 0) -> Summary:
    """The summary of a file of `size` bytes. One that is damaged is as good as none: a scan finds everything else.

    `start`: where it begins, if the file's end is not to be believed.
    """
    tail = os.pread(file.fileno(), _FOOTER_SIZE, max(len(MAGIC), size - _FOOTER_SIZE))
    if len(tail) < _FOOTER_SIZE or tail[-len(MAGIC) :] != MAGIC or tail[0] != Opcode.FOOTER:
        return Summary("it ends without its end record")
    try:
        footer = parse(Footer, tail[RECORD_HEAD.size :])
        start, end = start or footer.summary_start or size - _FOOTER_SIZE, size - _FOOTER_SIZE
        if not len(MAGIC) + _DATA_END_SIZE <= start <= end or end - start > MAX_BYTES:
            return Summary("its end names a place where no summary is")
        content = os.pread(file.fileno(), end - start, start)
        summed = zlib.crc32(tail[: -len(MAGIC) - 4], zlib.crc32(content))
        if footer.summary_crc not in (0, summed):
            return Summary("its summary has a wrong checksum")
        before = os.pread(file.fileno(), _DATA_END_SIZE, start - _DATA_END_SIZE)
        checksum = parse(DataEnd, before[RECORD_HEAD.size :]).data_section_crc if before[0] == Opcode.DATA_END else 0
        return replace(_contents(content), checksum=checksum)
    except Exception as error:
        return Summary(f"its summary cannot be read ({' '.join(str(error).split()):.80})")


def _contents(summary: bytes) -> Summary:
    descriptions, chunks, attachments, counts = [], [], [], None
    for opcode, start, end in records_in(summary):
        content = summary[start:end]
        if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            descriptions.append((opcode, content))
        elif opcode == Opcode.CHUNK_INDEX:
            index = parse(ChunkIndex, content)
            chunks.append(Place(index.chunk_start_offset, index.chunk_length))
        elif opcode == Opcode.ATTACHMENT_INDEX:
            index = parse(AttachmentIndex, content)
            attachments.append(Place(index.offset, index.length))
        elif opcode == Opcode.STATISTICS:
            said = parse(Statistics, content)
            if sum(said.channel_message_counts.values()) == said.message_count:
                counts = said.channel_message_counts
    return Summary("", descriptions, sorted(chunks), sorted(attachments), counts)


def walk(file: Any, size: int, known: list[Place]) -> Iterator[tuple[int, Place, bool]]:
    """The records of a file's data section: opcode, place (with its head), and whether it follows the one before.

    `known`: places that the summary names, in order. Where a record cannot be what it states, the walk continues at the
    next of them where a record of that length is. Ends with the end of the data, opcode DATA_END, or, where that was
    not found, with opcode 0.
    """
    at, follows = len(MAGIC), True
    while True:
        head = os.pread(file.fileno(), RECORD_HEAD.size, at)
        opcode, length = RECORD_HEAD.unpack(head) if len(head) == RECORD_HEAD.size else (0, 0)
        place = Place(at, RECORD_HEAD.size + length)
        whole = opcode > 0 and length <= MAX_BYTES and place.end <= size
        beyond = _next_known(file, known, at, place.end if whole else size)
        if beyond is not None:
            at, follows = beyond.start, False
            continue
        yield (opcode if whole else 0), (place if whole else Place(at, size - at)), follows
        if not whole or opcode == Opcode.DATA_END:
            return
        at, follows = place.end, True


def _next_known(file: Any, known: list[Place], start: int, end: int) -> Place | None:
    """The first record between two bytes that is there and as long as the summary states."""
    for place in known[bisect_right(known, start, key=lambda place: place.start) :]:
        if place.start >= end:
            return None
        head = os.pread(file.fileno(), RECORD_HEAD.size, place.start)
        if len(head) < RECORD_HEAD.size:
            return None
        opcode, length = RECORD_HEAD.unpack(head)
        if opcode in (Opcode.CHUNK, Opcode.ATTACHMENT) and RECORD_HEAD.size + length == place.length:
            return place
    return None
