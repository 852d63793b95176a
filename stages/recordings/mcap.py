"""Recordings in MCAP files: one, or the several that a rosbag2 folder splits a drive into."""

from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path
from typing import Any

from omninav.pipeline.mcap.log import Location, LogReader, Record

from .topics import TopicRecording, Topics, record_topics


def open_mcap(
    name: str, paths: Sequence[Path], topics: Topics, camera: Path | None = None, lost: Sequence[str] = ()
) -> TopicRecording:
    """A recording from MCAP files, in the order given; `lost` parts are counted as `missing_file`.

    Raises `UnreadableRecording` or `LogError`.
    """
    feed = LogReader(paths[0]) if len(paths) == 1 else SplitLog(paths)
    for file in lost:
        feed.drop("missing_file", f"{name}: its part {file} does not exist")
    return record_topics(name, feed, topics, camera, paths)


class SplitLog:
    """Several MCAP files as one feed."""

    def __init__(self, paths: Sequence[Path]) -> None:
        self._parts = [LogReader(path) for path in paths]
        self._dropped: Counter[str] = Counter()
        self._details: dict[str, str] = {}

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
        """What was lost in any part."""
        return sum((part.dropped for part in self._parts), self._dropped.copy())

    @property
    def details(self) -> dict[str, str]:
        """The first case of each kind."""
        return {kind: said for part in reversed(self._parts) for kind, said in part.details.items()} | self._details

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
        self._dropped[kind] += 1
        self._details.setdefault(kind, detail)
