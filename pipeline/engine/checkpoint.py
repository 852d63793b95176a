"""A run's memory between ticks as one sealed file: saved whole, loaded bit for bit."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from omninav.pipeline.files import write_whole

from .codec import BadEncoding, decode, encode, seal, unseal
from .grown_rows import GrownRows, grows

FORMAT = 5


class OtherVersion(BadEncoding):
    """A checkpoint that is whole, and was written in another format."""


@dataclass
class Checkpoint:
    """Everything that decides how a run continues.

    `identity`: hash of graph, inputs and seed, so that it is never used for another run. `ticks`: how many are done.
    `ended`: the logs have ended, only "after" stages are left. `replayed`: the prefix came from the cache. `channels`:
    delayed values, oldest first. `held`: last present values. `states`: fields of the stages' States. `generators`: bit
    generators' states. `notes`: what contexts counted. `sequences`: length in bytes of every growing sequence. A value
    that occurs in several places (one that is read delayed and kept for the end) is written once and is one object
    again when loaded.
    """

    identity: str
    ticks: int
    ended: bool = False
    replayed: bool = False
    channels: dict[str, list[Any]] = field(default_factory=dict)
    held: dict[str, Any] = field(default_factory=dict)
    states: dict[str, dict[str, Any]] = field(default_factory=dict)
    generators: dict[str, dict[str, Any]] = field(default_factory=dict)
    notes: dict[str, dict[str, Any]] = field(default_factory=dict)
    sequences: dict[str, int] = field(default_factory=dict)


def save(path: Path, checkpoint: Checkpoint, rows: GrownRows) -> None:
    """Write a checkpoint, whole or not at all. What grows is written to `rows` before."""
    objects: list[Any] = []
    numbers: dict[int, int] = {}
    grown: dict[int, tuple[str, dict[str, Any]]] = {}

    def number(value: Any, name: str) -> int:
        if id(value) not in numbers:
            own = numbers[id(value)] = len(objects)
            if grows(value):
                value, where = rows.write(name, value)
                grown[own] = name, where
            objects.append(value)
            return own
        return numbers[id(value)]

    content = {
        "format": FORMAT,
        **vars(checkpoint),
        "channels": {
            key: [number(value, key.partition("@")[0]) for value in values]
            for key, values in checkpoint.channels.items()
        },
        "held": {key: number(value, key) for key, value in checkpoint.held.items()},
        "objects": objects,
        "grown": grown,
    }
    write_whole(path, seal(encode(content)))


def load(path: Path, rows: GrownRows) -> Checkpoint:
    """Read a checkpoint, and what has grown from `rows`.

    Raises `BadEncoding` naming the file where one is damaged or of another version.
    """
    content = decode(unseal(path.read_bytes(), str(path)))
    try:
        if content.pop("format", None) != FORMAT:
            raise OtherVersion(f"{path} was written by another version of omninav; start the run again")
        objects = content.pop("objects")
        for number, (name, where) in content.pop("grown").items():
            rows.read(name, objects[number], where)
        content["channels"] = {key: [objects[n] for n in numbers] for key, numbers in content["channels"].items()}
        content["held"] = {key: objects[n] for key, n in content["held"].items()}
        return Checkpoint(**content)
    except BadEncoding:
        raise
    except (LookupError, TypeError, AttributeError, ValueError):
        raise BadEncoding(f"{path} is no checkpoint") from None
