"""Writing a log: an MCAP file of ROS 2 messages.

It opens with Foxglove, `mcap` and `ros2 bag play -s mcap FILE` as it is, and with rosbags as
`AnyReader([Path("FILE.mcap")])` (0.11 and later): message definitions are inside, so no `metadata.yaml` is needed.
"""

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from mcap.writer import CompressionType, Writer

from omninav.pipeline.files import whole_file

from .message import LogError
from .message_types import encode_message, standard_types


class LogStream:
    """Writes ROS 2 messages as MCAP to an open file, which is one once `finish` has been called.

    The bytes follow from what is written alone: no clock, no machine, no library version. `chunk_bytes`: how much is
    compressed and checksummed together, and so what a flipped bit costs at most. `path` is what messages name.
    """

    def __init__(self, file: IO[bytes], path: Path | str, chunk_bytes: int = 1 << 20) -> None:
        self.path = Path(path)
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, tuple[int, str]] = {}
        self._written: Counter[str] = Counter()
        self._writer = Writer(file, chunk_bytes, CompressionType.ZSTD, enable_crcs=True, enable_data_crcs=True)
        self._writer.start(profile="ros2", library="omninav")

    def write(
        self,
        topic: str,
        msgtype: str,
        stamp: int,
        content: Any,
        log_time: int | None = None,
    ) -> None:
        """Append a message. `stamp` (ns) goes into its header where the type has one, and is its log time by default.

        `content`: a rosbags message object, or a mapping of fields; fields left out are zero or empty.
        Raises `LogError` for an unknown type or field, and where a topic would change its type.
        """
        self.append(topic, msgtype, stamp, encode_message(msgtype, content, stamp), log_time)

    def append(self, topic: str, msgtype: str, stamp: int, data: bytes, log_time: int | None = None) -> None:
        """Append a message that is encoded already (CDR)."""
        channel, known = self._channels.get(topic, (0, msgtype))
        if known != msgtype:
            raise LogError(f"{self.path}: {topic} carries {known}, not {msgtype}; use another topic")
        if not channel:
            channel = self._open_channel(topic, msgtype)
        time = stamp if log_time is None else log_time
        self._writer.add_message(channel, time, data, time, self._written[topic])
        self._written[topic] += 1

    def attach(self, name: str, data: bytes, media_type: str = "application/octet-stream") -> None:
        """Append an attachment."""
        self._writer.add_attachment(0, 0, name, media_type, data)

    def finish(self) -> None:
        """Write what a file ends with."""
        self._writer.finish()  # type: ignore[no-untyped-call]

    def _open_channel(self, topic: str, msgtype: str) -> int:
        store = standard_types()
        if msgtype not in self._schemas:
            definition, _ = store.generate_msgdef(msgtype, ros_version=2)
            self._schemas[msgtype] = self._writer.register_schema(msgtype, "ros2msg", definition.encode())
        channel = self._writer.register_channel(
            topic,
            "cdr",
            self._schemas[msgtype],
            {"offered_qos_profiles": "", "topic_type_hash": store.hash_rihs01(msgtype)},
        )
        self._channels[topic] = (channel, msgtype)
        return channel


@contextmanager
def written_log(path: Path | str, chunk_bytes: int = 1 << 20) -> Iterator[LogStream]:
    """A log to write ROS 2 messages to; its file appears when the block ends well."""
    with whole_file(Path(path)) as part, part.open("wb") as file:
        log = LogStream(file, path, chunk_bytes)
        yield log
        log.finish()
