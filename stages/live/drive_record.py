"""The record of a live run: what it consumed, on disk tick by tick, so that nothing that was used is lost."""

import os
from collections.abc import Iterable
from pathlib import Path

from omninav.pipeline import named, open_itself
from omninav.pipeline.mcap.reader import LogReader
from omninav.pipeline.mcap.writer import LogStream
from omninav.stages.camera.model import Camera
from omninav.stages.recordings.camera_yaml import write_camera
from omninav.stages.recordings.live_record import CAMERA, HEADER, HEADER_TYPE, LiveHeader

from .transport import RawMessage


class DriveRecord:
    """An MCAP file that grows as `live.mcap.unfinished` and is `live.mcap` at its end.

    Every message is a chunk of its own, with a checksum, and on disk after each `write`: a run that is killed has all
    of it. A record that is there already is copied first, without an incomplete end, and continues.
    """

    def __init__(self, path: Path, header: LiveHeader, camera: Camera) -> None:
        self.path = path
        self._part, before = path.with_name(f"{path.name}.unfinished"), path.with_name(f"{path.name}.before")
        if not before.exists() and self._part.exists():
            os.replace(self._part, before)
        self._part.unlink(missing_ok=True)
        self._file = os.fdopen(open_itself(self._part, os.O_WRONLY | os.O_CREAT), "wb")
        self._stream = LogStream(self._file, path, chunk_bytes=1)
        self._stream.attach(CAMERA, write_camera(camera).encode(), "application/yaml")
        self._stream.write(HEADER, HEADER_TYPE, 0, {"data": header.text()})
        self._last = 0
        if before.exists():
            reader = LogReader(before)
            types = reader.topics
            self.write(
                RawMessage(record.topic, types[record.topic], record.log_time, bytes(record.data))
                for record in reader.scan(set(types) - {HEADER})
            )
            before.unlink()

    def write(self, messages: Iterable[RawMessage]) -> None:
        """Append messages, in this order whatever their times."""
        with named(self._part):
            for message in messages:
                self._last = max(message.received, self._last + 1)
                self._stream.append(message.topic, message.msgtype, self._last, message.data)
            self._file.flush()

    def close(self) -> None:
        """Give the record its end and its name."""
        with named(self._part):
            self._stream.finish()
            self._file.close()
        os.replace(self._part, self.path)


def unfinished(path: Path) -> Path:
    """The file of a record that has not ended: the one that is whole where a copy of it was under way."""
    before = path.with_name(f"{path.name}.before")
    return before if before.exists() else path.with_name(f"{path.name}.unfinished")
