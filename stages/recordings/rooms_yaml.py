"""`rooms.yaml`: what people call the parts of a place, attached to a log.

A list of `{name: kitchen, corners: [least x, least y, greatest x, greatest y]}` (m, in the frame of the true poses).
"""

from dataclasses import dataclass

import numpy as np
import yaml

from omninav.pipeline import convert, parse_yaml, user_path
from omninav.pipeline.mcap.reader import LogReader
from omninav.stages.values.rooms import Rooms

from .recording import UnreadableRecording

ROOMS = "rooms.yaml"
"""Its name as an attachment."""


@dataclass(frozen=True)
class RoomEntry:
    """One rectangle."""

    name: str
    corners: tuple[float, float, float, float]


def write_rooms(rooms: Rooms) -> str:
    """The text of a `rooms.yaml`."""
    entries = [
        {"name": name, "corners": [float(edge) for edge in row]}
        for name, row in zip(rooms.names, rooms.corners, strict=True)
    ]
    return yaml.safe_dump(entries, sort_keys=False, default_flow_style=None, allow_unicode=True)


def rooms_of_log(log: str) -> Rooms | None:
    """The rooms that are attached to an MCAP log; None where there are none. Raises `BadInput` for unsound ones."""
    path = user_path(log)
    attached = LogReader(path).attachments.get(ROOMS) if path.suffix == ".mcap" and path.is_file() else None
    if attached is None:
        return None
    where = f"{path}: attachment {ROOMS}"
    found, problems = convert(parse_yaml(attached, where) or [], tuple[RoomEntry, ...], "rooms")
    if problems:
        raise UnreadableRecording(f"{where}: {problems[0].where}: {problems[0].what}")
    return Rooms(tuple(room.name for room in found), np.array([room.corners for room in found]).reshape(-1, 4))
