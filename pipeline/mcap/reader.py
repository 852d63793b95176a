"""Reading a log as far as it is sound: damage costs only itself, and what was lost is counted by kind."""

import os
import struct
import zlib
from collections import Counter, OrderedDict
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, ChunkIndex, Footer, Schema

from .chunks import MAGIC, RECORD_HEAD, parse, records_in, unpack
from .message import BadMessage, Location, LogError, Message, Record
from .message_types import standard_types, types_of

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

_MESSAGE = struct.Struct("<HIQQ")
_STAMP_LITTLE, _STAMP_BIG = struct.Struct("<iI").unpack_from, struct.Struct(">iI").unpack_from
_FOOTER_SIZE = RECORD_HEAD.size + 20 + len(MAGIC)
_BYTES_IN_MEMORY = 32_000_000
"""Of unpacked chunks, beside the last one used: logs up to that size are unpacked once."""


class _Chunk(NamedTuple):
    start: int
    length: int
    whole: bool


class LogReader:
    """One MCAP file: its topics, attachments and messages, as far as they are sound.

    Opening reads the summary at the end of the file, where there is one, and nothing else. `scan` goes through the
    file once and keeps no message; `fetch` reads the bytes of one message again (some unpacked chunks stay in memory).
    `dropped` counts what was lost, by kind, and `details` tells the first case of each:

    * `cut_file`: the file ends before its end record;
    * `bad_chunk`: a chunk with a wrong checksum, or one that cannot be unpacked or found;
    * `bad_attachment`: an attachment with a wrong checksum;
    * `bad_message`: a message that its type's definition cannot decode (counted by whoever decodes).

    Raises `LogError` where the file does not exist or is no MCAP file.
    """

    def __init__(self, path: Path | str) -> None:
        self.path = Path(path)
        self.dropped: Counter[str] = Counter()
        self.details: dict[str, str] = {}
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._chunks: list[_Chunk] = []
        self._unpacked: OrderedDict[int, bytes] = OrderedDict()
        self._in_memory = 0
        self._stores: dict[str, Typestore] = {}
        self._known_channels: dict[int, tuple[str, bool]] = {}
        self._types: dict[str, str] = {}
        self._attachments: dict[str, bytes] = {}
        self._scanned = False
        try:
            with self.path.open("rb") as file:
                if file.read(len(MAGIC)) != MAGIC:
                    raise LogError(f"{self.path}: not an MCAP file (its first bytes are wrong)")
                self._size = file.seek(0, 2)
                self._known_chunks: list[ChunkIndex] = []
                try:
                    self._known_chunks = self._read_summary(file)
                except Exception:  # a damaged summary is as good as none: the scan finds everything else
                    self._channels.clear()
        except OSError as error:
            raise LogError(f"{self.path}: {error.strerror or error}") from None

    @property
    def topics(self) -> dict[str, str]:
        """Topic names and their message types, sorted by name."""
        if not self._channels:
            self._complete()
        return {
            channel.topic: self._type_of(channel)
            for channel in sorted(self._channels.values(), key=lambda channel: channel.topic)
        }

    @property
    def attachments(self) -> dict[str, bytes]:
        """Attachments by name."""
        self._complete()
        return self._attachments

    def scan(self, topics: Collection[str] | None = None) -> Iterator[Record]:
        """Every sound message of some topics (None: all), in the order of the file."""
        self._chunks.clear()
        self._unpacked.clear()
        self._in_memory = 0
        if self._scanned:  # a second pass counts nothing twice
            kept = self.dropped.copy()
            yield from self._scan(topics)
            self.dropped = kept
        else:
            yield from self._scan(topics)
            self._scanned = True

    def fetch(self, location: Location) -> bytes | memoryview:
        """The bytes of a message found by `scan`."""
        if location.chunk < 0:
            with self.path.open("rb") as file:
                file.seek(location.start)
                return file.read(location.length)
        data = self._unpacked.get(location.chunk)
        if data is None:
            chunk = self._chunks[location.chunk]
            with self.path.open("rb") as file:
                packed = os.pread(file.fileno(), chunk.length, chunk.start)
            data = unpack(packed, chunk.whole, check=False)  # `scan` has checked it
            self._unpacked[location.chunk] = data
            self._in_memory += len(data)
            while self._in_memory > _BYTES_IN_MEMORY and len(self._unpacked) > 1:
                self._in_memory -= len(self._unpacked.popitem(last=False)[1])
        else:
            self._unpacked.move_to_end(location.chunk)
        return memoryview(data)[location.start : location.start + location.length]

    def decode(self, topic: str, data: bytes | memoryview) -> Any:
        """A message object (fields as attributes, as ROS names them). Raises `BadMessage`."""
        msgtype = self._type_on(topic)
        try:
            return self._store(msgtype).deserialize_cdr(data, msgtype)
        except Exception as error:  # damaged bytes raise whatever the generated decoder stumbles over
            raise BadMessage(f"{self.path}: a message on {topic} is not a sound {msgtype} ({error})") from None

    def messages(self, topics: Collection[str] | None = None) -> Iterator[Message]:
        """Decoded messages in the order of their stamps; equal stamps in the order of the file."""
        found = [(record.stamp, number, record) for number, record in enumerate(_without_data(self.scan(topics)))]
        for stamp, _, record in sorted(found):
            try:
                content = self.decode(record.topic, self.fetch(record.location))
            except BadMessage as error:
                self.drop("bad_message", str(error))
                continue
            yield Message(record.topic, self._type_on(record.topic), stamp, record.log_time, content)

    def drop(self, kind: str, detail: str) -> None:
        """Count something lost."""
        self.dropped[kind] += 1
        self.details.setdefault(kind, detail)

    def _read_summary(self, file: Any) -> list[ChunkIndex]:
        """Schemas, channels and the places of chunks from the end of the file; nothing of it where it is not sound."""
        if self._size < _FOOTER_SIZE + len(MAGIC):
            return []
        file.seek(self._size - _FOOTER_SIZE)
        tail = file.read(_FOOTER_SIZE)
        if tail[-len(MAGIC) :] != MAGIC or tail[0] != Opcode.FOOTER:
            return []
        footer = parse(Footer, tail[RECORD_HEAD.size :])
        if not 0 < footer.summary_start <= self._size - _FOOTER_SIZE:
            return []
        file.seek(footer.summary_start)
        summary = file.read(self._size - _FOOTER_SIZE - footer.summary_start)
        if footer.summary_crc and zlib.crc32(tail[: -len(MAGIC) - 4], zlib.crc32(summary)) != footer.summary_crc:
            return []
        chunks = []
        for opcode, start, end in records_in(summary):
            if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                self._learn(opcode, summary[start:end])
            elif opcode == Opcode.CHUNK_INDEX:
                chunks.append(parse(ChunkIndex, summary[start:end]))
        return sorted(chunks, key=lambda chunk: chunk.chunk_start_offset)

    def _complete(self) -> None:
        """Go through the file once if that has not happened: attachments, and what the summary would have held."""
        if not self._scanned:
            for _ in self.scan(()):
                pass

    def _learn(self, opcode: int, content: bytes) -> None:
        try:
            if opcode == Opcode.SCHEMA:
                schema = parse(Schema, content)
                self._schemas[schema.id] = schema
            else:
                channel = parse(Channel, content)
                self._channels[channel.id] = channel
        except Exception as error:
            self.drop("bad_chunk", f"{self.path}: a topic's description is damaged ({error})")

    def _scan(self, topics: Collection[str] | None) -> Iterator[Record]:
        seen = set()
        with self.path.open("rb") as file:
            for opcode, start, length, whole in self._walk(file):
                if opcode == Opcode.CHUNK:
                    seen.add(start - RECORD_HEAD.size)
                    packed = os.pread(file.fileno(), length, start)  # past the file's buffer, which would copy it
                    self._chunks.append(_Chunk(start, length, whole))
                    try:
                        data = unpack(packed, whole)
                    except Exception as error:
                        if whole:
                            self.drop(
                                "bad_chunk",
                                f"{self.path}: chunk at byte {start - RECORD_HEAD.size}: {error}",
                            )
                        continue
                    number = len(self._chunks) - 1
                    if self._in_memory + len(data) <= _BYTES_IN_MEMORY:
                        self._unpacked[number] = data
                        self._in_memory += len(data)
                    yield from self._in_chunk(data, number, topics, whole)
                elif not whole:
                    continue
                elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                    file.seek(start)
                    self._learn(opcode, file.read(length))
                elif opcode == Opcode.MESSAGE and length >= _MESSAGE.size:
                    file.seek(start)
                    content = file.read(length)
                    channel, _, log_time, _ = _MESSAGE.unpack_from(content)
                    data_at = Location(-1, start + _MESSAGE.size, length - _MESSAGE.size)
                    yield from self._record(channel, log_time, content[_MESSAGE.size :], data_at, topics)
                elif opcode == Opcode.ATTACHMENT:
                    file.seek(start)
                    self._attach(file.read(length), start)
        for chunk in self._known_chunks:
            if chunk.chunk_start_offset not in seen:
                self.drop(
                    "bad_chunk",
                    f"{self.path}: chunk at byte {chunk.chunk_start_offset} cannot be found",
                )

    def _walk(self, file: Any) -> Iterator[tuple[int, int, int, bool]]:
        """Records of the data section: opcode, first byte of the content, length, whether it is all there.

        Where a record's length cannot be true, the walk goes on at the next chunk that the summary knows of; without a
        summary the file counts as cut there.
        """
        at = len(MAGIC)
        starts = [chunk.chunk_start_offset for chunk in self._known_chunks]
        while True:
            file.seek(at)
            head = file.read(RECORD_HEAD.size)
            opcode, length = RECORD_HEAD.unpack(head) if len(head) == RECORD_HEAD.size else (0, 0)
            if opcode == Opcode.DATA_END:
                return
            start, end = at + RECORD_HEAD.size, at + RECORD_HEAD.size + length
            beyond = [known for known in starts if known > at]
            leaps = bool(beyond) and end > beyond[0]
            if head and opcode > 0 and end <= self._size and not leaps and len(head) == RECORD_HEAD.size:
                yield opcode, start, length, True
                at = end
            elif beyond:
                at = beyond[0]
            elif starts:  # the last chunk's own frame is damaged, and nothing follows that is needed
                return
            else:
                self.drop(
                    "cut_file",
                    f"{self.path}: ends at byte {self._size} in the middle of a record, without its end",
                )
                if opcode == Opcode.CHUNK:
                    yield opcode, start, self._size - start, False
                return

    def _in_chunk(self, data: bytes, chunk: int, topics: Collection[str] | None, whole: bool) -> Iterator[Record]:
        end = 0
        for opcode, start, end in records_in(data):
            if opcode == Opcode.MESSAGE and end - start >= _MESSAGE.size:
                channel, _, log_time, _ = _MESSAGE.unpack_from(data, start)
                start += _MESSAGE.size
                data_at = Location(chunk, start, end - start)
                yield from self._record(channel, log_time, memoryview(data)[start:end], data_at, topics)
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                self._learn(opcode, data[start:end])
        if whole and end != len(data):
            self.drop(
                "bad_chunk",
                f"{self.path}: chunk {chunk}: its records end before it does",
            )

    def _record(
        self,
        number: int,
        log_time: int,
        data: bytes | memoryview,
        at: Location,
        topics: Collection[str] | None,
    ) -> Iterator[Record]:
        known = self._read_as(number)
        if known is None:
            self.drop("bad_message", f"{self.path}: a message names channel {number}, which is not described")
            return
        topic, has_header = known
        if topics is None or topic in topics:
            stamp = log_time
            if has_header and len(data) >= 12:
                seconds, nanoseconds = _STAMP_LITTLE(data, 4) if data[1] & 1 else _STAMP_BIG(data, 4)
                stamp = seconds * 1_000_000_000 + nanoseconds
            yield Record(topic, stamp, log_time, data, at)

    def _attach(self, content: bytes, start: int) -> None:
        try:
            if len(content) < 4 or int.from_bytes(content[-4:], "little") not in (
                0,
                zlib.crc32(content[:-4]),
            ):
                raise ValueError("checksum is wrong")
            attachment = parse(Attachment, content)
            self._attachments[attachment.name] = attachment.data
        except Exception as error:
            self.drop("bad_attachment", f"{self.path}: attachment at byte {start}: {error}")

    def _type_on(self, topic: str) -> str:
        if topic not in self._types:
            self._types = {channel.topic: self._type_of(channel) for channel in self._channels.values()}
        return self._types[topic]

    def _type_of(self, channel: Channel) -> str:
        schema = self._schemas.get(channel.schema_id)
        return schema.name if schema else ""

    def _read_as(self, number: int) -> tuple[str, bool] | None:
        """Topic of a channel and whether its messages begin with a header; None where nothing describes it."""
        if number not in self._known_channels:
            channel = self._channels.get(number)
            if channel is None:
                return None
            msgtype = self._type_of(channel)
            fields = self._store(msgtype).fielddefs.get(msgtype, ([], []))[1]
            self._known_channels[number] = channel.topic, bool(fields) and fields[0][1][1] == "std_msgs/msg/Header"
        return self._known_channels[number]

    def _store(self, msgtype: str) -> "Typestore":
        """The types that this file's own definition of a message type brings along."""
        if msgtype not in self._stores:
            schema = next((schema for schema in self._schemas.values() if schema.name == msgtype), None)
            self._stores[msgtype] = (
                standard_types() if schema is None else types_of(msgtype, schema.encoding, schema.data)
            )
        return self._stores[msgtype]


def read_messages(path: Path | str, topics: Collection[str] | None = None) -> Iterator[Message]:
    """Decoded messages of a log in the order of their header stamps. See `LogReader` for what becomes of damage."""
    yield from LogReader(path).messages(topics)


def _without_data(records: Iterator[Record]) -> Iterator[Record]:
    return (record._replace(data=b"") for record in records)
