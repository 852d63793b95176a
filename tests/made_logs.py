"""Small recordings for tests: textured pictures, odometry and truth on a circle, written as MCAP, rosbag2 or ROS 1."""

import copy
import functools
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np

from omninav.pipeline.mcap.message_types import make_message, standard_types
from omninav.pipeline.mcap.writer import written_log

CAMERA = b"projection: cylindrical\nimage: {width: 48, height: 16}\ncolumn_of_forward: 24\n"
START = 1_700_000_000_000_000_000
FRAMES = 20
IMAGE, ODOMETRY, TRUTH = "/camera/image/compressed", "/odom", "/ground_truth/pose"


class Made(NamedTuple):
    """One message on its way into a log."""

    topic: str
    msgtype: str
    stamp: int
    log_time: int
    content: Any


def picture(number: int) -> np.ndarray:
    return np.random.default_rng(number).integers(0, 256, (16, 48, 3), dtype=np.uint8)


def encoded(pixels: np.ndarray, kind: str = ".png") -> bytes:
    return bytes(cv2.imencode(kind, pixels)[1])


def compressed(stamp: int, data: bytes) -> Any:
    return make_message("sensor_msgs/msg/CompressedImage", {"format": "png", "data": data}, stamp)


def pose_at(seconds: float) -> tuple[float, float, float]:
    """A circle of 1 m at 0.2 rad/s, from the origin to the left."""
    angle = 0.2 * seconds
    return math.sin(angle), 1 - math.cos(angle), angle


def pose_fields(x: float, y: float, heading: float) -> dict[str, Any]:
    return {"position": {"x": x, "y": y}, "orientation": {"z": math.sin(heading / 2), "w": math.cos(heading / 2)}}


def messages(change: Callable[[Made], list[Made]] = lambda made: [made]) -> Iterator[Made]:
    """Pictures at 2 Hz between odometry and truth at 20 Hz; `change` may drop, replace or repeat each message."""
    for made in _untouched():
        yield from change(made._replace(content=copy.deepcopy(made.content)))


@functools.cache
def _untouched() -> tuple[Made, ...]:
    found = []
    for step in range(FRAMES * 10 + 1):
        stamp, seconds = START + step * 50_000_000, step * 0.05
        fields = {"pose": {"pose": pose_fields(*pose_at(seconds))}, "child_frame_id": "base_link"}
        odometry = make_message("nav_msgs/msg/Odometry", fields, stamp)
        found.append(Made(ODOMETRY, "nav_msgs/msg/Odometry", stamp, stamp + 1000, odometry))
        truth = make_message("geometry_msgs/msg/PoseStamped", {"pose": pose_fields(*pose_at(seconds))}, stamp)
        found.append(Made(TRUTH, "geometry_msgs/msg/PoseStamped", stamp, stamp + 2000, truth))
        if step % 10 == 5:
            at, number = stamp + 17_000_000, step // 10
            content = compressed(at, encoded(picture(number)))
            found.append(Made(IMAGE, "sensor_msgs/msg/CompressedImage", at, at + 42_000, content))
    return tuple(found)


def write_mcap(path: Path, made: Iterator[Made] | None = None, camera: bytes | None = CAMERA) -> Path:
    with written_log(path, chunk_bytes=8000) as log:
        if camera is not None:
            log.attach("camera.yaml", camera)
        for message in made if made is not None else messages():
            log.write(message.topic, message.msgtype, message.stamp, message.content, message.log_time)
    return path


def write_rosbag2(
    folder: Path, made: Iterator[Made] | None = None, prepare: Callable[[Any], None] = lambda writer: None
) -> Path:
    from rosbags.rosbag2 import Writer

    store = standard_types()
    writer = Writer(folder, version=9)
    prepare(writer)
    with writer:
        connections: dict[str, Any] = {}
        for m in made if made is not None else messages():
            if m.topic not in connections:
                connections[m.topic] = writer.add_connection(m.topic, m.msgtype, typestore=store)
            writer.write(connections[m.topic], m.log_time, store.serialize_cdr(m.content, m.msgtype))
    (folder / "camera.yaml").write_bytes(CAMERA)
    return folder


def write_rosbag1(path: Path, made: Iterator[Made] | None = None) -> Path:
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    ros1, ros2 = get_typestore(Stores.ROS1_NOETIC), standard_types()
    with Writer(path) as writer:
        connections: dict[str, Any] = {}
        for m in made if made is not None else messages():
            if m.topic not in connections:
                connections[m.topic] = writer.add_connection(m.topic, m.msgtype, typestore=ros1)
            raw = ros2.cdr_to_ros1(ros2.serialize_cdr(m.content, m.msgtype), m.msgtype)
            writer.write(connections[m.topic], m.log_time, raw)
    (path.parent / "camera.yaml").write_bytes(CAMERA)
    return path
