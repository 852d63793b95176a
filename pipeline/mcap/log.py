"""Logs: MCAP files of ROS 2 messages, written whole and read as far as they are sound.

What `LogWriter` writes opens with Foxglove, `mcap` and `ros2 bag play -s mcap FILE` as it is, and with rosbags as
`AnyReader([Path("FILE.mcap")])` (0.11 and later): message definitions are inside, so no `metadata.yaml` is needed.

Reading trusts nothing: every chunk's checksum is verified, a damaged chunk costs only itself, and a file that was cut
gives every whole message before the cut. What was lost is counted by kind.
"""

import os
import struct
import zlib
from collections import Counter, OrderedDict
from collections.abc import Collection, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cache
from io import BytesIO
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import zstandard
from lz4 import frame as lz4
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, ChunkIndex, Footer, Schema
from mcap.writer import CompressionType, Writer

from omninav.pipeline.files import whole_file
from omninav.pipeline.graph.problems import BadInput, nearest

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

MAGIC = b"\x89MCAP0\r\n"
_RECORD = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<HIQQ")
_STAMP_LITTLE, _STAMP_BIG = struct.Struct("<iI").unpack_from, struct.Struct(">iI").unpack_from
_FOOTER_SIZE = _RECORD.size + 20 + len(MAGIC)
_DEFINITION_ENCODINGS = ("ros2msg", "ros2idl")
_CHUNK_HEAD = struct.Struct("<QQQII")
_LENGTH = struct.Struct("<Q")
_BYTES_IN_MEMORY = 32_000_000
"""Of unpacked chunks, beside the last one used: logs up to that size are unpacked once."""


class LogError(BadInput):
    """A log that cannot be read or written at all. The message is one line: which file, what, and what to do."""


class BadMessage(Exception):
    """One message that cannot be decoded. The message is one line: which topic and what is wrong."""


@dataclass(frozen=True)
class Message:
    """A decoded message. `stamp`: header stamp (ns), or the log time where its type has no header."""

    topic: str
    msgtype: str
    stamp: int
    log_time: int
    content: Any


class Location(NamedTuple):
    """Where a message's bytes lie: number of its chunk (-1: directly in the file), first byte, length."""

    chunk: int
    start: int
    length: int


class Record(NamedTuple):
    """One message as found by a scan: not decoded, with its times (ns) and where to find its bytes again."""

    topic: str
    stamp: int
    log_time: int
    data: bytes | memoryview
    location: Any


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
            data = _unpack(packed, chunk.whole, check=False)  # `scan` has checked it
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
        footer = _parse(Footer, tail[_RECORD.size :])
        if not 0 < footer.summary_start <= self._size - _FOOTER_SIZE:
            return []
        file.seek(footer.summary_start)
        summary = file.read(self._size - _FOOTER_SIZE - footer.summary_start)
        if footer.summary_crc and zlib.crc32(tail[: -len(MAGIC) - 4], zlib.crc32(summary)) != footer.summary_crc:
            return []
        chunks = []
        for opcode, start, end in _records(summary):
            if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                self._learn(opcode, summary[start:end])
            elif opcode == Opcode.CHUNK_INDEX:
                chunks.append(_parse(ChunkIndex, summary[start:end]))
        return sorted(chunks, key=lambda chunk: chunk.chunk_start_offset)

    def _complete(self) -> None:
        """Go through the file once if that has not happened: attachments, and what the summary would have said."""
        if not self._scanned:
            for _ in self.scan(()):
                pass

    def _learn(self, opcode: int, content: bytes) -> None:
        try:
            if opcode == Opcode.SCHEMA:
                schema = _parse(Schema, content)
                self._schemas[schema.id] = schema
            else:
                channel = _parse(Channel, content)
                self._channels[channel.id] = channel
        except Exception as error:
            self.drop("bad_chunk", f"{self.path}: a topic's description is damaged ({error})")

    def _scan(self, topics: Collection[str] | None) -> Iterator[Record]:
        seen = set()
        with self.path.open("rb") as file:
            for opcode, start, length, whole in self._walk(file):
                if opcode == Opcode.CHUNK:
                    seen.add(start - _RECORD.size)
                    packed = os.pread(file.fileno(), length, start)  # past the file's buffer, which would copy it
                    self._chunks.append(_Chunk(start, length, whole))
                    try:
                        data = _unpack(packed, whole)
                    except Exception as error:
                        if whole:
                            self.drop(
                                "bad_chunk",
                                f"{self.path}: chunk at byte {start - _RECORD.size}: {error}",
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
            head = file.read(_RECORD.size)
            opcode, length = _RECORD.unpack(head) if len(head) == _RECORD.size else (0, 0)
            if opcode == Opcode.DATA_END:
                return
            start, end = at + _RECORD.size, at + _RECORD.size + length
            beyond = [known for known in starts if known > at]
            leaps = bool(beyond) and end > beyond[0]
            if head and opcode > 0 and end <= self._size and not leaps and len(head) == _RECORD.size:
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
        for opcode, start, end in _records(data):
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
            attachment = _parse(Attachment, content)
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


@cache
def standard_types() -> "Typestore":
    """The message types that come with ROS 2."""
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_HUMBLE)


@cache
def types_of(msgtype: str, encoding: str, definition: bytes) -> "Typestore":
    """The message types in a definition; the standard ones where it is not whole or not readable."""
    from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

    if encoding not in _DEFINITION_ENCODINGS:
        return standard_types()
    store = get_typestore(Stores.EMPTY)
    try:
        text = definition.decode()
        store.register(get_types_from_msg(text, msgtype) if encoding == "ros2msg" else get_types_from_idl(text))
        store.get_msgdef(msgtype)  # fails where a part of the definition is missing
    except Exception:
        return standard_types()
    return store


class LogWriter:
    """Writes one MCAP file of ROS 2 messages; a context manager, the file appears when its block ends well.

    The bytes follow from what is written alone: no clock, no machine, no library version. `chunk_bytes`: how much is
    compressed and checksummed together, and so what a flipped bit costs at most.
    """

    def __init__(self, path: Path | str, chunk_bytes: int = 1 << 20) -> None:
        self.path, self.chunk_bytes = Path(path), chunk_bytes
        self._stack = ExitStack()
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, tuple[int, str]] = {}
        self._written: Counter[str] = Counter()

    def __enter__(self) -> "LogWriter":
        part = self._stack.enter_context(whole_file(self.path))
        file = self._stack.enter_context(part.open("wb"))
        self._writer = Writer(file, self.chunk_bytes, CompressionType.ZSTD, enable_crcs=True, enable_data_crcs=True)
        self._writer.start(profile="ros2", library="omninav")
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if kind is None:
            self._writer.finish()  # type: ignore[no-untyped-call]
        self._stack.__exit__(kind, error, trace)

    def write(
        self,
        topic: str,
        msgtype: str,
        stamp: int,
        content: Any,
        log_time: int | None = None,
    ) -> None:
        """Append a message. `stamp` (ns) goes into its header where the type has one, and is its log time by default.

        `content`: a rosbags message object, or a mapping of fields; fields left out are zero or empty.
        Raises `LogError` for an unknown type or field, and where a topic would change its type.
        """
        if isinstance(content, Mapping):
            content = make_message(msgtype, content, stamp)
        try:
            data = bytes(standard_types().serialize_cdr(content, msgtype))
        except Exception as error:
            raise LogError(f"{self.path}: {topic}: not a valid {msgtype} ({error})") from None
        channel, known = self._channels.get(topic, (0, msgtype))
        if known != msgtype:
            raise LogError(f"{self.path}: {topic} carries {known}, not {msgtype}; use another topic")
        if not channel:
            channel = self._open_channel(topic, msgtype)
        time = stamp if log_time is None else log_time
        self._writer.add_message(channel, time, data, time, self._written[topic])
        self._written[topic] += 1

    def attach(self, name: str, data: bytes, media_type: str = "application/octet-stream") -> None:
        """Append an attachment."""
        self._writer.add_attachment(0, 0, name, media_type, data)

    def _open_channel(self, topic: str, msgtype: str) -> int:
        store = standard_types()
        if msgtype not in self._schemas:
            definition, _ = store.generate_msgdef(msgtype, ros_version=2)
            self._schemas[msgtype] = self._writer.register_schema(msgtype, "ros2msg", definition.encode())
        channel = self._writer.register_channel(
            topic,
            "cdr",
            self._schemas[msgtype],
            {"offered_qos_profiles": "", "topic_type_hash": store.hash_rihs01(msgtype)},
        )
        self._channels[topic] = (channel, msgtype)
        return channel


def make_message(msgtype: str, fields: Mapping[str, Any], stamp: int | None = None) -> Any:
    """A rosbags message from nested mappings; fields left out are zero or empty, `stamp` (ns) fills the header.

    Raises `LogError` for an unknown type or field, with the nearest name.
    """
    store = standard_types()
    if msgtype not in store.fielddefs:
        raise LogError(f"{msgtype}: no such message type{_nearest(msgtype, store.fielddefs)}")
    definitions = dict(store.fielddefs[msgtype][1])
    for name in fields:
        if name not in definitions:
            raise LogError(f"{msgtype}: no field '{name}'{_nearest(name, definitions)}")
    values = {name: _make_field(definition, fields.get(name)) for name, definition in definitions.items()}
    if stamp is not None and "header" in definitions:
        seconds, nanoseconds = divmod(stamp, 1_000_000_000)
        values["header"].stamp.sec, values["header"].stamp.nanosec = (
            seconds,
            nanoseconds,
        )
    return store.types[msgtype](**values)


def _make_field(definition: Any, value: Any) -> Any:
    from rosbags.interfaces import Nodetype

    kind, detail = definition
    if kind == Nodetype.NAME:
        return make_message(detail, value or {}) if value is None or isinstance(value, Mapping) else value
    if kind == Nodetype.BASE:
        name = detail[0]
        empty: Any = "" if name in ("string", "wstring") else False if name == "bool" else 0
        return empty if value is None else value
    inner, count = detail
    if inner[0] == Nodetype.BASE and inner[1][0] not in ("string", "wstring"):
        dtype = np.dtype({"octet": "uint8", "byte": "uint8", "char": "uint8"}.get(inner[1][0], inner[1][0]))
        if value is None:
            return np.zeros(count if kind == Nodetype.ARRAY else 0, dtype)
        return np.frombuffer(value, dtype) if isinstance(value, (bytes, memoryview)) else np.asarray(value, dtype)
    length = count if kind == Nodetype.ARRAY else 0
    return [_make_field(inner, item) for item in (value if value is not None else [None] * length)]


def _nearest(name: str, names: Collection[str]) -> str:
    near = nearest(name, names)
    return f"; did you mean '{near}'?" if near else ""


def _without_data(records: Iterator[Record]) -> Iterator[Record]:
    return (record._replace(data=b"") for record in records)


def _records(data: bytes) -> Iterator[tuple[int, int, int]]:
    """Records in a run of bytes: opcode, first byte of the content, end. Stops before one that is not whole."""
    at = 0
    while at + _RECORD.size <= len(data):
        opcode, length = _RECORD.unpack_from(data, at)
        start = at + _RECORD.size
        at = start + length
        if at > len(data):
            return
        yield opcode, start, at


def _parse(kind: Any, content: bytes) -> Any:
    return kind.read(ReadDataStream(BytesIO(content)))


def _unpack(content: bytes, whole: bool, check: bool = True) -> bytes:
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
