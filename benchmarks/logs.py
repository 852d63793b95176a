"""Reading and decoding an MCAP log, beside mcap-ros2-support on the same file."""

import tempfile
from pathlib import Path

import numpy as np

from omninav.pipeline.log import LogWriter, read_messages

from .table import Row, medians

MESSAGES = 20_000


def rows() -> list[Row]:
    """Odometry and pictures as a robot records them, read message by message."""
    with tempfile.TemporaryDirectory() as place:
        odometry, pictures = Path(place) / "odometry.mcap", Path(place) / "pictures.mcap"
        with LogWriter(odometry) as log:
            for number in range(MESSAGES):
                pose = {"pose": {"pose": {"position": {"x": number * 0.01}, "orientation": {"w": 1.0}}}}
                log.write(
                    "/odom", "nav_msgs/msg/Odometry", number * 50_000_000, {"header": {"frame_id": "odom"}, **pose}
                )
        rng = np.random.default_rng(0)
        with LogWriter(pictures) as log:
            for number in range(300):
                noise = rng.integers(0, 255, 60_000, dtype=np.uint8)  # as little to compress as in a JPEG
                image = {"header": {"frame_id": "camera"}, "format": "jpeg", "data": noise}
                log.write("/image", "sensor_msgs/msg/CompressedImage", number * 100_000_000, image)
        return [_row("odometry", odometry), _row("pictures", pictures)]


def _row(what: str, path: Path) -> Row:
    size = path.stat().st_size / 1e6
    functions = {"ours": lambda: sum(1 for _ in read_messages(path)), "theirs": lambda: _theirs(path)}
    taken = medians(functions, rounds=5)
    raw = _content(path) / 1e6
    return Row(
        f"MCAP read and decode, {what} ({size:.1f} MB, CRCs checked)",
        raw / taken["ours"],
        "MB/s",
        "mcap-ros2-support (no CRC check)",
        raw / taken["theirs"],
        limit=1.0,
        of_peer=True,
        higher_is_better=True,
    )


def _theirs(path: Path) -> int:
    from mcap_ros2.reader import read_ros2_messages

    return sum(1 for _ in read_ros2_messages(path))


def _content(path: Path) -> int:
    from mcap.reader import make_reader

    with path.open("rb") as file:
        return sum(len(message.data) for _, _, message in make_reader(file).iter_messages())
