"""Recordings in rosbag2 folders and ROS 1 bags, read with the library rosbags."""

import bz2
import io
import sqlite3
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from itertools import compress
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import zstandard

if TYPE_CHECKING:
    from rosbags.highlevel import AnyReader

from omninav.pipeline import BadInput, read_yaml, user_path
from omninav.pipeline.mcap.chunks import MAX_BYTES, MAX_RATIO, Allowance, unpack_lz4, unpack_zstd
from omninav.pipeline.mcap.message import BadMessage, Losses, Record
from omninav.pipeline.mcap.message_types import has_header, header_stamp, refuse_long_arrays, standard_types

from .recording import Format, OpenOptions, UnreadableRecording
from .topic_recording import TopicRecording
from .topics import record_topics

STEPS, MIN_STEPS, STEPS_PER_BYTE = 10_000, 2_000_000, 20
"""SQLite calls the progress handler every `STEPS` steps of its virtual machine. A query may take `MIN_STEPS`, and
`STEPS_PER_BYTE` more for each byte of the file: a row has at least 25 bytes and takes some 30 steps."""
ROS1 = b"#ROSBAG V2.0"
"""First bytes of a bag of ROS 1."""
MIN_VALUE_BYTES = 1_000_000
"""Size up to which a value in an SQLite file is always accepted, however small the file is."""


class Rosbag(Format):
    """ROS 1 bags and rosbag2 in SQLite."""

    names = "a .bag or .db3 file"
    suffixes = (".bag", ".db3")

    def opens(self, log: str) -> bool:
        """Such a file, or a rosbag2 folder."""
        path = user_path(log)
        return super().opens(log) or (path / "metadata.yaml").is_file() or any(path.glob("*.db3"))

    def open(self, log: str, options: OpenOptions) -> TopicRecording:
        """With the library rosbags. Raises `UnreadableRecording`."""
        path = user_path(log)
        files = sorted(file for file in path.iterdir() if file.is_file()) if path.is_dir() else [path]
        return record_topics(log, BagFeed(path), options, files)


class _Limits:
    """Limits of what rosbags may unpack of a bag, and of SQLite's time for one question."""

    def __init__(self, files: Sequence[Path]) -> None:
        self._size = sum(file.stat().st_size for file in files)
        self._max_value_bytes = self._size * (MAX_RATIO if any(file.suffix == ".zstd" for file in files) else 1)
        self.begin()

    def begin(self) -> None:
        """From now on the bag is read again from its beginning, or another message is looked up."""
        self.allowance = Allowance(self._size)
        self._steps = MIN_STEPS + STEPS_PER_BYTE * self._size

    def bz2(self, packed: bytes) -> bytes:
        """A chunk of a ROS 1 bag. Raises ValueError where the bag unpacks to more than a log holds."""
        return self._unpacked(bz2.BZ2Decompressor().decompress(packed, max_length=MAX_BYTES))

    def lz4(self, packed: bytes) -> bytes:
        """As `bz2`."""
        return self._unpacked(unpack_lz4(packed, MAX_BYTES))

    def _unpacked(self, data: bytes) -> bytes:
        self.allowance.unpack(len(data))
        return data

    def limit(self, connection: Any) -> Any:
        """A connection to a file of SQLite that holds no longer value than the file, and that works no longer on a
        question than it takes to look at every row, some times over."""
        limit = getattr(connection, "setlimit", None) or connection.limit  # of sqlite3; of apsw, which rosbags has now
        limit(sqlite3.SQLITE_LIMIT_LENGTH, min(MAX_BYTES, max(self._max_value_bytes, MIN_VALUE_BYTES)))
        limit(sqlite3.SQLITE_LIMIT_LIKE_PATTERN_LENGTH, 100)
        connection.set_progress_handler(self._works_on, STEPS)
        for table in ("messages", "topics"):
            if any(hidden for *_, hidden in connection.execute(f"PRAGMA table_xinfo({table})")):
                raise ValueError(f"a column of its table {table} is computed, expected stored values")
        return connection

    def _works_on(self) -> bool:
        self._steps -= STEPS
        return self._steps < 0


class _Sqlite:
    """In place of the module by which rosbags opens files of SQLite: their connections are limited."""

    def __init__(self, module: Any, limits: _Limits) -> None:
        self._module: Any = module._module if isinstance(module, _Sqlite) else module
        self._limits = limits

    def __getattr__(self, name: str) -> Any:
        found = getattr(self._module, name)
        if name not in ("connect", "Connection"):  # of sqlite3 and of apsw
            return found
        return lambda *arguments, **named: self._limits.limit(found(*arguments, **named))


class _Zstd:
    """In place of rosbags' own: a message, and a file of a rosbag2 folder, unpack within the limits of our logs."""

    @staticmethod
    def decompress(packed: bytes) -> bytes:
        """A message. Raises ValueError."""
        unpacked = unpack_zstd(packed, MAX_BYTES)
        if len(unpacked) > MAX_BYTES:
            raise ValueError(f"a message unpacks to more than {MAX_BYTES} bytes")
        return unpacked

    @staticmethod
    def open(file: BinaryIO, mode: str) -> "_LimitedFile":
        """A file, to be read from its start."""
        return _LimitedFile(file)


class _LimitedFile(io.RawIOBase):
    """Content of a zstd file; OSError where it is beyond all proportion to the file's size."""

    def __init__(self, file: BinaryIO) -> None:
        self._limit = max(MAX_BYTES // 2, MAX_RATIO * file.seek(0, io.SEEK_END))
        file.seek(0)
        self._stream = zstandard.ZstdDecompressor(max_window_size=MAX_BYTES).stream_reader(
            file, read_across_frames=True, closefd=False
        )
        self._read = 0

    def readable(self) -> bool:
        """It is."""
        return True

    def readinto(self, buffer: Any) -> int:
        """The next bytes."""
        number = self._stream.readinto(buffer)
        self._read += number
        if self._read > self._limit:
            raise OSError(f"a file unpacks to more than {self._limit} bytes")
        return int(number)


def _stated_counts(path: Path) -> dict[str, int]:
    """Numbers of messages of each topic by a folder's metadata. Raises `BadInput` where it names other files."""
    found = read_yaml(path / "metadata.yaml")
    stated = found["rosbag2_bagfile_information"]
    for name in stated["relative_file_paths"]:
        if Path(name).name != name or not (path / name).is_file():
            raise BadInput(f"{path}: metadata.yaml names {name!s:.80}, which is no file of this folder")
    topics = stated["topics_with_message_count"]
    return {str(each["topic_metadata"]["name"]): int(each["message_count"]) for each in topics}


class BagFeed(Losses):
    """A bag as a feed of messages. What rosbags finds wrong on the way ends the scan and counts as `bad_chunk`."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.path = path
        self.attachments: dict[str, bytes] = {}
        for part in (path / "metadata.yaml", *path.glob("*.db3")) if path.is_dir() else (path,):
            if part.exists() and not part.is_file():
                raise UnreadableRecording(f"{part}: this is a folder, a pipe or a device, expected a file")
        if path.suffix == ".bag" and path.is_file():
            with path.open("rb") as file:
                if file.read(len(ROS1)) != ROS1:
                    raise UnreadableRecording(
                        f"{path}: this is no bag of ROS 1, which begins with '{ROS1.decode()}'; if it is another kind "
                        "of recording, rename it to end as such files do (.mcap, .db3, .mp4)"
                    )
        self._stated: dict[str, int] = {}
        self._sound_types: set[str] = set()
        files = [file for file in path.iterdir() if file.is_file()] if path.is_dir() else [path]
        self._limits = _Limits(files)
        try:
            if (path / "metadata.yaml").is_file():
                self._stated = _stated_counts(path)
            self._reader = self._open([path])
        except Exception as error:  # rosbags and the libraries under it raise many kinds for a damaged bag
            said = " ".join(str(error).split())[:160] or type(error).__name__
            try:
                parts = sorted(path.glob("*.db3")) if path.is_dir() else []
                self._reader = self._open(parts)  # each part can be read without the folder's metadata
            except Exception as last:
                if parts and not self._stated:  # else the first error tells more
                    said = " ".join(str(last).split())[:160] or said
                repair = "rosbag reindex" if path.suffix == ".bag" else "ros2 bag reindex"
                raise UnreadableRecording(
                    f"{path}: not a readable bag ({said}); if it was cut off, repair it with {repair}"
                ) from None
            self.drop("bad_metadata", f"{path}: metadata.yaml cannot be used ({said})")
        named = [isinstance(c.topic, str) and isinstance(c.msgtype, str) for c in self._reader.connections]
        self._connections = list(compress(self._reader.connections, named))
        if not all(named):  # a column of SQLite holds anything
            self.drop("bad_chunk", f"{path}: a topic has no name, or no type", named.count(False))

    def _open(self, paths: list[Path]) -> "AnyReader":
        from rosbags.highlevel import AnyReader  # slow to import, and seldom needed
        from rosbags.rosbag1.reader import decompressors
        from rosbags.rosbag2 import reader as rosbag2
        from rosbags.rosbag2 import storage_sqlite3 as storage

        decompressors.update(bz2=self._limits.bz2, lz4=self._limits.lz4)
        vars(rosbag2)["zstd"] = _Zstd
        for name in {"sqlite3", "apsw"} & {*vars(storage)}:
            vars(storage)[name] = _Sqlite(vars(storage)[name], self._limits)
        self._limits.begin()
        reader = AnyReader(paths, default_typestore=standard_types())
        reader.open()
        return reader

    @property
    def topics(self) -> dict[str, str]:
        """Topics and their types."""
        return dict(sorted((connection.topic, connection.msgtype) for connection in self._connections))

    def scan(self, topics: Collection[str] | None = None) -> Iterator[Record]:
        """Messages in the order of the bag's times."""
        wanted = [c for c in self._connections if topics is None or c.topic in topics]
        headed = {c.topic: has_header(self._reader.typestore, c.msgtype) for c in wanted}
        number: Counter[tuple[str, int]] = Counter()
        found: Counter[str] = Counter()
        self._limits.begin()
        allowance = self._limits.allowance
        try:
            for connection, time, data in self._reader.messages(wanted) if wanted else ():
                allowance.read_message()
                topic = connection.topic
                if not (
                    isinstance(time, int) and 0 <= time < 2**63 and isinstance(data, bytes | memoryview)
                ):  # SQLite holds all
                    self.drop("bad_message", f"{self.path}: a message on {topic:.80} is no message, or has no time")
                    continue
                allowance.unpack(len(data))
                written = header_stamp(data, cdr=self._reader.is2) if headed[topic] else None
                stamp = time if written is None else written
                yield Record(topic, stamp, time, data, (topic, time, number[topic, time]))
                number[topic, time] += 1
                found[topic] += 1
        except Exception as error:
            self.drop("bad_chunk", f"{self.path}: reading stopped ({' '.join(str(error).split()):.160})")
        for topic in {connection.topic for connection in wanted}:
            stated = self._stated.pop(topic, 0)  # reported once, however often it is read
            if stated > found[topic]:
                lost = stated - found[topic]
                self.drop("missing_message", f"{self.path}: messages are missing: {lost} of {stated} on {topic}", lost)

    def fetch(self, location: tuple[str, int, int]) -> bytes:
        """The bytes of a message again. Raises `BadMessage`."""
        topic, time, number = location
        wanted = [c for c in self._connections if c.topic == topic]
        self._limits.begin()
        try:
            for passed, (_, _, data) in enumerate(self._reader.messages(wanted, start=time, stop=time + 1)):
                if passed == number:
                    return bytes(data)
        except Exception as error:
            raise BadMessage(f"{self.path}: a message on {topic} cannot be read again ({error!s:.160})") from None
        raise BadMessage(f"{self.path}: a message on {topic} cannot be found again")

    def decode(self, topic: str, data: bytes | memoryview) -> Any:
        """A message object. Raises `BadMessage`."""
        msgtype = self.topics[topic]
        try:
            if msgtype not in self._sound_types:
                refuse_long_arrays(self._reader.typestore, msgtype)
                self._sound_types.add(msgtype)
            return self._reader.deserialize(bytes(data), msgtype)
        except Exception as error:
            raise BadMessage(f"{self.path}: a message on {topic} is not a sound {msgtype} ({error!s:.160})") from None
