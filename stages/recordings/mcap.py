"""Recordings in MCAP files: one, or the several that a rosbag2 folder splits a drive into."""

from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path
from typing import Any

from omninav.pipeline import BadInput, read_yaml, user_path
from omninav.pipeline.mcap.message import Location, Losses, Record
from omninav.pipeline.mcap.reader import LogReader

from .live_record import HEADER, LiveRecording
from .recording import Format, OpenOptions, UnreadableRecording
from .topic_recording import TopicRecording
from .topics import record_topics


class Mcap(Format):
    """MCAP with ROS 2 messages: one file, or the several of a rosbag2 folder.

    Read by our own reader, which survives damage; parts that are lost are counted as `missing_file`.
    """

    names = "a .mcap file or a rosbag2 folder"
    suffixes = (".mcap",)

    def opens(self, log: str) -> bool:
        """A .mcap file, or a folder that holds some."""
        return super().opens(log) or any(user_path(log).glob("*.mcap"))

    def open(self, log: str, options: OpenOptions) -> TopicRecording:
        """The files of a folder in the order of its metadata. Raises `UnreadableRecording` or `LogError`."""
        path = user_path(log)
        if not path.is_dir():
            return _one_file(log, path, options)
        parts = sorted(path.glob("*.mcap"))
        if bags := sorted(path.glob("*.db3")):
            raise UnreadableRecording(
                f"{log}: it holds MCAP and SQLite files ({parts[0].name}, {bags[0].name}); give each part: "
                f"log=[{parts[0]},{bags[0]}]"
            )
        listed = _listed(path / "metadata.yaml") or [part.name for part in parts]
        there = [path / file for file in listed if (path / file).is_file()] or parts
        feed = LogReader(there[0]) if len(there) == 1 else SplitLog(there)
        for file in listed:
            if not (path / file).is_file():
                feed.drop("missing_file", f"{log}: its part {file} does not exist")
        return record_topics(log, feed, options, there)


def _one_file(log: str, path: Path, options: OpenOptions) -> TopicRecording:
    feed = LogReader(path)
    if HEADER not in feed.topics:
        return record_topics(log, feed, options, [path])
    recording = LiveRecording(log, feed, [path])
    if not len(recording.stamps):
        raise UnreadableRecording(f"{log}: the live run that it records has made no tick; name another")
    return recording


def _listed(path: Path) -> list[str]:
    """The files that a rosbag2 folder is made of, in their order; none where its metadata cannot be read."""
    try:
        content = read_yaml(path)
        return [Path(file).name for file in content["rosbag2_bagfile_information"]["relative_file_paths"]]
    except (BadInput, KeyError, TypeError):
        return []


class SplitLog:
    """Several MCAP files as one feed."""

    def __init__(self, paths: Sequence[Path]) -> None:
        self._parts = [LogReader(path) for path in paths]
        self._own = Losses()

    @property
    def topics(self) -> dict[str, str]:
        """Topics and types of all parts."""
        return dict(sorted(item for part in self._parts for item in part.topics.items()))

    @property
    def attachments(self) -> dict[str, bytes]:
        """Attachments of all parts; of equal names the first part's."""
        return {name: data for part in reversed(self._parts) for name, data in part.attachments.items()}

    @property
    def dropped(self) -> Counter[str]:
        """Data lost in any part."""
        return sum((part.dropped for part in self._parts), self._own.dropped.copy())

    @property
    def details(self) -> dict[str, str]:
        """The first case of each kind."""
        return {kind: said for part in reversed(self._parts) for kind, said in part.details.items()} | self._own.details

    def scan(self, topics: Collection[str] | None = None) -> Iterator[Record]:
        """Every sound message, part by part."""
        for number, part in enumerate(self._parts):
            for record in part.scan(topics):
                yield record._replace(location=(number, record.location))

    def fetch(self, location: tuple[int, Location]) -> bytes | memoryview:
        """The bytes of a message again."""
        part, inside = location
        return self._parts[part].fetch(inside)

    def decode(self, topic: str, data: bytes | memoryview) -> Any:
        """A message object."""
        return next(part for part in self._parts if topic in part.topics).decode(topic, data)

    def drop(self, kind: str, detail: str) -> None:
        """Count something lost."""
        self._own.drop(kind, detail)
