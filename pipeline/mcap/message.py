"""Messages as they are stored in a log and as they are decoded, and the errors of those that are unsound."""

from collections import Counter
from dataclasses import dataclass
from typing import Any, NamedTuple

from omninav.pipeline.graph.problems import BadInput


class LogError(BadInput):
    """A log that cannot be read or written at all. The message is one line: which file, what, and what to do."""


class BadMessage(Exception):
    """One message that cannot be decoded. The message is one line: which topic and what is wrong."""


class Losses:
    """Counts what could not be used: `dropped` by kind, and `details` with the first case of each."""

    def __init__(self) -> None:
        self.dropped: Counter[str] = Counter()
        self.details: dict[str, str] = {}

    def drop(self, kind: str, detail: str, number: int = 1) -> None:
        """Count something lost."""
        self.dropped[kind] += number
        self.details.setdefault(kind, detail)


@dataclass(frozen=True)
class Message:
    """A decoded message. `stamp`: header stamp (ns), or the log time where its type has no header."""

    topic: str
    msgtype: str
    stamp: int
    log_time: int
    content: Any


class Location(NamedTuple):
    """Position of a message's bytes: number of its chunk (-1: directly in the file), first byte, length."""

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
