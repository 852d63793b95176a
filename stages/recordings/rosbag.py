"""Recordings in rosbag2 folders and ROS 1 bags, read with the library rosbags."""

import struct
from collections import Counter
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

import yaml
from rosbags.highlevel import AnyReader

from omninav.pipeline.mcap.log import BadMessage, Record, standard_types

from .mcap import open_mcap
from .recording import UnreadableRecording
from .topics import TopicRecording, Topics, record_topics


def open_rosbag(name: str, path: Path, topics: Topics, camera: Path | None = None) -> TopicRecording:
    """A recording from a ROS 1 .bag, a .db3 file, or a rosbag2 folder.

    A folder of plain MCAP files is read by our own reader, which survives damage. Raises `UnreadableRecording`.
    """
    parts = sorted(path.glob("*.mcap")) if path.is_dir() else []
    if parts:
        listed = _listed(path / "metadata.yaml") or [part.name for part in parts]
        there = [path / file for file in listed if (path / file).is_file()]
        lost = [file for file in listed if not (path / file).is_file()]
        return open_mcap(name, there or parts, topics, camera, lost)
    return record_topics(name, BagFeed(path), topics, camera, _files(path))


def _files(path: Path) -> list[Path]:
    return sorted(file for file in path.iterdir() if file.is_file()) if path.is_dir() else [path]


def _listed(path: Path) -> list[str]:
    """The files that a rosbag2 folder is made of, in their order; none where its metadata cannot be read."""
    try:
        content = yaml.safe_load(path.read_text())
        return [Path(file).name for file in content["rosbag2_bagfile_information"]["relative_file_paths"]]
    except (OSError, yaml.YAMLError, UnicodeDecodeError, KeyError, TypeError):
        return []


class BagFeed:
    """A bag as a feed of messages. What rosbags finds wrong on the way ends the scan and counts as `bad_chunk`."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.dropped: Counter[str] = Counter()
        self.details: dict[str, str] = {}
        self.attachments: dict[str, bytes] = {}
        try:
            self._reader = self._open([path])
        except Exception as error:  # rosbags and the libraries under it raise many kinds for a damaged bag
            said = " ".join(str(error).split()) or type(error).__name__
            try:
                parts = sorted(path.glob("*.db3")) if path.is_dir() else []
                self._reader = self._open(parts)  # each part can be read without the folder's metadata
            except Exception:
                repair = "rosbag reindex" if path.suffix == ".bag" else "ros2 bag reindex"
                raise UnreadableRecording(
                    f"{path}: not a readable bag ({said}); if it was cut off, repair it with {repair}"
                ) from None
            self.drop("bad_metadata", f"{path}: metadata.yaml cannot be used ({said})")

    def _open(self, paths: list[Path]) -> AnyReader:
        reader = AnyReader(paths, default_typestore=standard_types())
        reader.open()
        return reader

    @property
    def topics(self) -> dict[str, str]:
        """Topics and their types."""
        return dict(sorted((connection.topic, connection.msgtype) for connection in self._reader.connections))

    def scan(self, topics: Collection[str] | None = None) -> Iterator[Record]:
        """Messages in the order of the bag's times."""
        wanted = [c for c in self._reader.connections if topics is None or c.topic in topics]
        headers = {c.topic: self._has_header(c.msgtype) for c in wanted}
        number: Counter[tuple[str, int]] = Counter()
        try:
            for connection, time, data in self._reader.messages(wanted) if wanted else ():
                topic, stamp = connection.topic, time
                if headers[topic] and len(data) >= 12:
                    stamp = self._stamp(data)
                yield Record(topic, stamp, time, data, (topic, time, number[topic, time]))
                number[topic, time] += 1
        except Exception as error:
            self.drop("bad_chunk", f"{self.path}: reading stopped ({' '.join(str(error).split())})")

    def fetch(self, location: tuple[str, int, int]) -> bytes:
        """The bytes of a message again. Raises `BadMessage`."""
        topic, time, number = location
        wanted = [c for c in self._reader.connections if c.topic == topic]
        try:
            for passed, (_, _, data) in enumerate(self._reader.messages(wanted, start=time, stop=time + 1)):
                if passed == number:
                    return bytes(data)
        except Exception as error:
            raise BadMessage(f"{self.path}: a message on {topic} cannot be read again ({error})") from None
        raise BadMessage(f"{self.path}: a message on {topic} cannot be found again")

    def decode(self, topic: str, data: bytes | memoryview) -> Any:
        """A message object. Raises `BadMessage`."""
        msgtype = self.topics[topic]
        try:
            return self._reader.deserialize(bytes(data), msgtype)
        except Exception as error:
            raise BadMessage(f"{self.path}: a message on {topic} is not a sound {msgtype} ({error})") from None

    def drop(self, kind: str, detail: str) -> None:
        """Count something lost."""
        self.dropped[kind] += 1
        self.details.setdefault(kind, detail)

    def _has_header(self, msgtype: str) -> bool:
        fields = self._reader.typestore.fielddefs.get(msgtype, ([], []))[1]
        return bool(fields) and fields[0][1][1] == "std_msgs/msg/Header"

    def _stamp(self, data: bytes | memoryview) -> int:
        # CDR: 4 bytes of encapsulation, then the stamp. ROS 1: 4 bytes of sequence number, then the stamp
        big = self._reader.is2 and not data[1] & 1
        seconds, nanoseconds = struct.unpack_from(">iI" if big else "<iI", data, 4)
        return int(seconds * 1_000_000_000 + nanoseconds)
