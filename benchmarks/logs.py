"""Reading and decoding an MCAP log, beside mcap-ros2-support on the same file."""

import tempfile
from pathlib import Path

import numpy as np

from omninav.pipeline.mcap.reader import LogReader
from omninav.pipeline.mcap.writer import written_log

from .table import Row, medians

MESSAGES = 20_000


def rows() -> list[Row]:
    """Odometry and pictures as a robot records them, read message by message."""
    with tempfile.TemporaryDirectory() as place:
        odometry, pictures = Path(place) / "odometry.mcap", Path(place) / "pictures.mcap"
        with written_log(odometry) as log:
            for number in range(MESSAGES):
                pose = {"pose": {"position": {"x": number * 0.01}, "orientation": {"w": 1.0}}}
                odometry_of = {"header": {"frame_id": "odom"}, "pose": pose}
                log.write("/odom", "nav_msgs/msg/Odometry", number * 50_000_000, odometry_of)
        rng = np.random.default_rng(0)
        with written_log(pictures) as log:
            for number in range(300):
                noise = rng.integers(0, 255, 60_000, dtype=np.uint8)  # as little to compress as in a JPEG
                image = {"header": {"frame_id": "camera"}, "format": "jpeg", "data": noise}
                log.write("/image", "sensor_msgs/msg/CompressedImage", number * 100_000_000, image)
        return [*_rows("odometry", odometry), *_rows("pictures", pictures)]


def _rows(what: str, path: Path) -> list[Row]:
    """Ours checks every checksum and sorts by header stamps; theirs with and without checking."""
    taken = medians(
        {
            "ours": lambda: sum(1 for _ in LogReader(path).messages()),
            "checked": lambda: _theirs(path, True),
            "unchecked": lambda: _theirs(path, False),
        },
        rounds=5,
    )
    raw = _content(path) / 1e6
    name = f"MCAP read and decode, {what} ({raw:.1f} MB)"
    return [
        Row(name, raw / taken["ours"], "MB/s", peer, raw / taken[kind], limit, True, True)
        for kind, peer, limit in (
            ("checked", "mcap-ros2-support, CRCs checked", 1.0),
            ("unchecked", "mcap-ros2-support, unchecked", None),
        )
    ]


def _theirs(path: Path, check: bool) -> int:
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=check, decoder_factories=[DecoderFactory()])
        return sum(1 for _ in reader.iter_decoded_messages())


def _content(path: Path) -> int:
    from mcap.reader import make_reader

    with path.open("rb") as file:
        return sum(len(message.data) for _, _, message in make_reader(file).iter_messages())
