"""A run's memory between ticks as one sealed file: saved whole, loaded bit for bit."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from omninav.pipeline.files import write_whole

from .codec import BadEncoding, decode, encode, seal, unseal

FORMAT = 3


class OtherVersion(BadEncoding):
    """A checkpoint that is whole, and was written in another format."""


@dataclass
class Checkpoint:
    """Everything that decides how a run goes on.

    `identity`: hash of graph, inputs and seed, so that it is never used for another run. `ticks`: how many are done.
    `ended`: the logs have ended, only "after" stages are left. `replayed`: the prefix came from the cache. `channels`:
    delayed values, oldest first. `held`: last present values. `states`: fields of the stages' States. `generators`: bit
    generators' states. `notes`: what contexts counted. `sequences`: length in bytes of every growing sequence. A value
    that stands in several places (one that is read delayed and kept for the end) is written once and is one object
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


def save(path: Path, checkpoint: Checkpoint) -> None:
    """Write a checkpoint, whole or not at all."""
    objects: list[Any] = []
    numbers: dict[int, int] = {}

    def number(value: Any) -> int:
        if id(value) not in numbers:
            numbers[id(value)] = len(objects)
            objects.append(value)
        return numbers[id(value)]

    content = {
        "format": FORMAT,
        "identity": checkpoint.identity,
        "ticks": checkpoint.ticks,
        "ended": checkpoint.ended,
        "replayed": checkpoint.replayed,
        "channels": {key: [number(value) for value in values] for key, values in checkpoint.channels.items()},
        "held": {key: number(value) for key, value in checkpoint.held.items()},
        "states": checkpoint.states,
        "generators": checkpoint.generators,
        "notes": checkpoint.notes,
        "sequences": checkpoint.sequences,
        "objects": objects,
    }
    write_whole(path, seal(encode(content)))


def load(path: Path) -> Checkpoint:
    """Read a checkpoint. Raises `BadEncoding` naming the file where it is damaged or of another version."""
    content = decode(unseal(path.read_bytes(), str(path)))
    try:
        if content.pop("format", None) != FORMAT:
            raise OtherVersion(f"{path} was written by another version of omninav; start the run again")
        objects = content.pop("objects")
        content["channels"] = {key: [objects[n] for n in numbers] for key, numbers in content["channels"].items()}
        content["held"] = {key: objects[n] for key, n in content["held"].items()}
        return Checkpoint(**content)
    except (LookupError, TypeError, AttributeError):
        raise BadEncoding(f"{path} is no checkpoint") from None
