"""Reading a log as far as it is sound: damage costs only itself, and what was lost is counted by kind."""

import os
import struct
import zlib
from collections import Counter, OrderedDict
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, MessageIndex, Schema

from omninav.pipeline.graph.problems import counted

from .chunks import MAGIC, RECORD_HEAD, Allowance, Place, parse, records_in, unpack
from .message import BadMessage, Location, LogError, Losses, Message, Record
from .message_types import has_header, header_stamp, standard_types, types_of
from .summary import read_summary, walk

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

_MESSAGE = struct.Struct("<HIQQ")
_BYTES_IN_MEMORY = 32_000_000
"""Unpacked chunks kept beside the last one used, bytes: logs up to that size are unpacked once."""

_BYTES_OF_ATTACHMENTS = 32_000_000
"""That are kept: descriptions of sensors are far shorter."""
_LAST_TIME = 2**63
"""Times are kept as signed numbers of 64 bits, as ROS has them."""


class LogReader(Losses):
    """One MCAP file: its topics, attachments and messages, as far as they are sound.

    Opening reads the summary at the end of the file, where there is one, and nothing else. `scan` goes through the
    file once and keeps no message; `fetch` reads the bytes of one message again (some unpacked chunks stay in memory).
    `dropped` counts what was lost, by kind, and `details` tells the first case of each:

    * `cut_file`: the file ends before its end record;
    * `bad_summary`: the file's summary at its end is damaged, so that nothing shows what is missing;
    * `bad_chunk`: a chunk with a wrong checksum, or one that cannot be unpacked or found;
    * `bad_checksum`: the file's bytes were changed, and nothing shows where;
    * `missing_message`: how many messages fewer there are than the file states;
    * `bad_attachment`: an attachment with a wrong checksum;
    * `bad_message`: a message that its type's definition cannot decode (counted by the code that decodes).

    Raises `LogError` where the file does not exist or is no MCAP file.
    """

    def __init__(self, path: Path | str) -> None:
        super().__init__()
        self.path = Path(path)
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._chunks: list[tuple[Place, bool]] = []
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
                self._summary = read_summary(file, self._size)
                for opcode, content in self._summary.descriptions:
                    self._learn(opcode, content)
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
            place, whole = self._chunks[location.chunk]
            with self.path.open("rb") as file:
                packed = os.pread(file.fileno(), place.length, place.start)
            data = unpack(packed[RECORD_HEAD.size :], whole, check=False)  # `scan` has checked it
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
            raise BadMessage(
                f"{self.path}: a message on {topic} is not a sound {msgtype:.80} ({error!s:.160})"
            ) from None

    def messages(self, topics: Collection[str] | None = None) -> Iterator[Message]:
        """Decoded messages in the order of their stamps; equal stamps in the order of the file."""
        found = [(each.stamp, number, each._replace(data=b"")) for number, each in enumerate(self.scan(topics))]
        for stamp, _, record in sorted(found):
            try:
                content = self.decode(record.topic, self.fetch(record.location))
            except BadMessage as error:
                self.drop("bad_message", str(error))
                continue
            yield Message(record.topic, self._type_on(record.topic), stamp, record.log_time, content)

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
            self.drop("bad_chunk", f"{self.path}: a topic's description is damaged ({error!s:.160})")

    def _scan(self, topics: Collection[str] | None) -> Iterator[Record]:
        before, seen, checksum = self.dropped.total(), set(), zlib.crc32(MAGIC)
        self._found: Counter[int] = Counter()
        self._allowance = Allowance(self._size)
        expected = Counter(self._summary.counts or {})
        opcode, unbroken = 0, True
        with self.path.open("rb") as file:
            for opcode, place, follows in walk(
                file, self._size, sorted(self._summary.chunks + self._summary.attachments)
            ):
                if opcode == Opcode.DATA_END:
                    if self._summary.damage:  # bytes that are missing moved it away from where the file's end states
                        moved = read_summary(file, self._size, place.end)
                        expected = Counter(moved.counts) or expected
                        for described, content in moved.descriptions:  # of topics without any message
                            self._learn(described, content)
                    break
                unbroken = unbroken and follows
                record = os.pread(file.fileno(), place.length, place.start)
                if self._summary.checksum:
                    checksum = zlib.crc32(record, checksum)
                content = record[RECORD_HEAD.size :]
                if record[:1] == bytes([Opcode.CHUNK]):  # whole, or cut off
                    seen.add(place)
                    yield from self._chunk(content, place, topics, whole=opcode > 0)
                elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                    self._learn(opcode, content)
                elif opcode == Opcode.MESSAGE and len(content) >= _MESSAGE.size:
                    channel, _, log_time, _ = _MESSAGE.unpack_from(content)
                    start = place.start + RECORD_HEAD.size + _MESSAGE.size
                    data_at = Location(-1, start, len(content) - _MESSAGE.size)
                    yield from self._record(channel, log_time, content[_MESSAGE.size :], data_at, topics)
                elif opcode == Opcode.ATTACHMENT:
                    self._attach(content, place.start)
                elif opcode == Opcode.MESSAGE_INDEX and self._summary.counts is None:
                    self._expect(content, expected)
        for chunk in self._summary.chunks:
            if chunk not in seen:
                self.drop("bad_chunk", f"{self.path}: chunk at byte {chunk.start} cannot be found")
        self._compare(opcode == Opcode.DATA_END, unbroken, checksum, expected, before)

    def _compare(self, ended: bool, unbroken: bool, checksum: int, expected: Counter[int], before: int) -> None:
        """Count what the file states to have and what was not found in it."""
        missing = {number: count - self._found[number] for number, count in expected.items()}
        missing = {number: count for number, count in missing.items() if count > 0}
        if missing:
            named = sorted((self._topic_of(number), count, expected[number]) for number, count in missing.items())
            said = ", ".join(f"{count} of {of} on {topic:.80}" for topic, count, of in named[:3])
            more = f" and of {counted(len(named) - 3, 'more topic')}" if len(named) > 3 else ""
            self.drop("missing_message", f"{self.path}: messages are missing: {said}{more}", sum(missing.values()))
        if self._summary.damage:
            kind = "bad_summary" if ended and not self._summary.damage.startswith("it ends") else "cut_file"
            self.drop(kind, f"{self.path}: {self._summary.damage}, after {self._size} bytes")
            return
        sound = ended and unbroken and self._summary.checksum in (0, checksum)
        if not sound and self.dropped.total() == before:  # nothing else explains a checksum that is wrong
            self.drop("bad_checksum", f"{self.path}: its bytes were changed, their checksum is wrong")

    def _expect(self, index: bytes, expected: Counter[int]) -> None:
        """Count the messages that the chunk before a message index holds, or held."""
        try:
            entries = parse(MessageIndex, index)
            expected[entries.channel_id] += len(entries.records)
        except Exception as error:
            self.drop("bad_chunk", f"{self.path}: a message index is damaged ({error!s:.80})")

    def _chunk(self, content: bytes, place: Place, topics: Collection[str] | None, whole: bool) -> Iterator[Record]:
        self._chunks.append((place, whole))
        try:
            data = unpack(content, whole)
            self._allowance.unpack(len(data))
        except Exception as error:
            if whole:
                self.drop("bad_chunk", f"{self.path}: chunk at byte {place.start}: {' '.join(str(error).split()):.160}")
            return
        number = len(self._chunks) - 1
        if self._in_memory + len(data) <= _BYTES_IN_MEMORY:
            self._unpacked[number] = data
            self._in_memory += len(data)
        yield from self._in_chunk(data, number, topics, whole)

    def _in_chunk(self, data: bytes, chunk: int, topics: Collection[str] | None, whole: bool) -> Iterator[Record]:
        end = 0
        for opcode, start, end in records_in(data):
            if opcode == Opcode.MESSAGE and end - start >= _MESSAGE.size:
                try:
                    self._allowance.read_message()
                except ValueError as error:
                    self.drop("bad_chunk", f"{self.path}: chunk {chunk}: {error}")
                    return
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
        self._found[number] += 1
        known = self._read_as(number)
        if known is None:
            self.drop("bad_message", f"{self.path}: a message names channel {number}, which is not described")
            return
        topic, headed = known
        if topics is None or topic in topics:
            written = header_stamp(data) if headed else None
            stamp = log_time if written is None else written
            if stamp >= _LAST_TIME:
                self.drop("bad_message", f"{self.path}: a message on {topic:.80} has the time {stamp} ns")
                return
            yield Record(topic, stamp, log_time, data, at)

    def _attach(self, content: bytes, start: int) -> None:
        try:
            if len(content) < 4 or int.from_bytes(content[-4:], "little") not in (
                0,
                zlib.crc32(content[:-4]),
            ):
                raise ValueError("checksum is wrong")
            if sum(map(len, self._attachments.values())) + len(content) > _BYTES_OF_ATTACHMENTS:
                raise ValueError(f"all together are larger than {_BYTES_OF_ATTACHMENTS} bytes")
            attachment = parse(Attachment, content)
            if self._attachments.setdefault(attachment.name, attachment.data) != attachment.data:
                raise ValueError(f"there is another '{attachment.name:.80}' before it, which is used")
        except Exception as error:
            self.drop("bad_attachment", f"{self.path}: attachment at byte {start}: {error!s:.160}")

    def _type_on(self, topic: str) -> str:
        if topic not in self._types:
            self._types = {channel.topic: self._type_of(channel) for channel in self._channels.values()}
        return self._types[topic]

    def _topic_of(self, number: int) -> str:
        return self._channels[number].topic if number in self._channels else f"channel {number}"

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
            self._known_channels[number] = channel.topic, has_header(self._store(msgtype), msgtype)
        return self._known_channels[number]

    def _store(self, msgtype: str) -> "Typestore":
        """The types that this file's own definition of a message type brings along."""
        if msgtype not in self._stores:
            schema = next((schema for schema in self._schemas.values() if schema.name == msgtype), None)
            self._stores[msgtype] = (
                standard_types() if schema is None else types_of(msgtype, schema.encoding, schema.data)
            )
        return self._stores[msgtype]
