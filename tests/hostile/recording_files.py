"""What is read beside a log or in its place: cameras, grids, folders of images with their tables, and bags."""

import functools
import sqlite3
import struct
import tempfile
import zlib
from collections.abc import Sequence
from pathlib import Path
from random import Random
from typing import Any

import cv2
import made_logs
import numpy as np

from omninav.pipeline.graph.problems import BadInput
from omninav.stages.recordings.camera_yaml import read_camera
from omninav.stages.recordings.occupancy_grid import read_grid, read_occupancy
from omninav.stages.recordings.opening import open_recording
from omninav.stages.recordings.recording import Recording
from omninav.stages.source.goal_image import read_image
from omninav.stages.values.encoded_image import Undecodable, decode_image

from .harness import Format, Wrong, not_finite
from .mutations import BINARY, SIZES, TEXT, Files, on

CAMERAS = (
    made_logs.CAMERA,
    b"projection: hyperbolic\nimage: {width: 280, height: 210}\nK: [[217.4, 0, 139.5], [0, 217.4, 104.5], [0, 0, 1]]\n"
    b"mirror: {a: 28.1, b: 23.4, unit: mm}\nmask: {inner_radius_px: 15, outer_radius_px: 104}\nheight: 1.2\nyaw: 0.1\n",
    b"projection: equirectangular\nimage: {width: 64, height: 32}\ncolumn_of_forward: 32\nsense: clockwise\n"
    b"elevation: {top: 0.6, bottom: -0.8}\n",
)
FRAMES = 4
COLUMNS = (
    ("messages", "timestamp"),
    ("messages", "data"),
    ("messages", "topic_id"),
    ("topics", "name"),
    ("topics", "type"),
    ("topics", "serialization_format"),
    ("message_definitions", "encoded_message_definition"),
)
"""Of a bag in SQLite."""
LAYOUT = b"""\
frames:
  csv: frames.csv
  file: file
  rename: [{replace: '^(.*)$', by: '\\1'}]
  time: {column: "time [ms]", unit: ms}
positions:
  x: {column: "x [cm]", unit: cm}
  y: {column: "y [cm]", unit: cm}
heading: {column: "heading [deg]", unit: deg}
camera: {projection: cylindrical, column_of_forward: 12, sense: clockwise, elevation: {top: 0.6, bottom: -0.8}}
"""


def cameras() -> Sequence[Files]:
    """A camera of each kind."""
    return [{"camera.yaml": camera} for camera in CAMERAS]


@functools.cache
def grids() -> Sequence[Files]:
    """A small grid as PGM and as PNG."""
    cells = np.full((20, 30), 254, np.uint8)
    cells[5:9, 3:20], cells[12:, 25:] = 0, 205
    about = b"image: map.%s\nresolution: 0.05\norigin: [-1.0, -2.0, 0.0]\nnegate: 0\noccupied_thresh: 0.65\n"
    about += b"free_thresh: 0.196\n"
    return [
        {"map.yaml": about % kind.encode(), f"map.{kind}": bytes(cv2.imencode(f".{kind}", cells)[1])}
        for kind in ("pgm", "png")
    ]


@functools.cache
def folders() -> Sequence[Files]:
    """A folder of images with a table of times and positions."""
    pixels = np.random.default_rng(0).integers(0, 256, (FRAMES, 8, 24, 3), dtype=np.uint8)
    rows = ["file,time [ms],x [cm],y [cm],heading [deg]"]
    rows += [f"{n:02}.jpg,{1000 + 500 * n},{10.5 * n:.2f},{-3.25 * n:.2f},{20.0 * n:.3f}" for n in range(FRAMES)]
    files = {f"{n:02}.jpg": bytes(cv2.imencode(".jpg", pixels[n])[1]) for n in range(FRAMES)}
    return [files | {"frames.csv": "\n".join(rows).encode() + b"\n", "recording.yaml": LAYOUT}]


@functools.cache
def images() -> Sequence[Files]:
    """An image of each kind of file."""
    pixels = np.random.default_rng(0).integers(0, 256, (8, 24, 3), dtype=np.uint8)
    kinds: tuple[tuple[str, tuple[int, ...]], ...] = (
        (".png", ()),
        (".jpg", ()),
        (".jpg", (cv2.IMWRITE_JPEG_PROGRESSIVE, 1)),
        (".bmp", ()),
        (".ppm", ()),
        (".tiff", ()),
        (".webp", ()),
        (".webp", (cv2.IMWRITE_WEBP_QUALITY, 101)),
    )
    return [{"goal.png": bytes(cv2.imencode(kind, pixels, options)[1])} for kind, options in kinds]


@functools.cache
def bags() -> Sequence[Files]:
    """A ROS 1 bag and a rosbag2 folder of SQLite."""
    with tempfile.TemporaryDirectory() as scratch:
        messages = list(made_logs.messages())[:85]
        one, two = Path(scratch, "one", "log.bag"), Path(scratch, "two", "bag")
        one.parent.mkdir()
        two.parent.mkdir()
        made_logs.write_rosbag1(one, iter(messages))
        made_logs.write_rosbag2(two, iter(messages))
        return [
            {str(path.relative_to(root)): path.read_bytes() for path in sorted(root.rglob("*")) if path.is_file()}
            for root in (one.parent, two.parent)
        ]


def camera_of(folder: Path, files: Files) -> Any:
    """A camera and what it says of some directions."""
    camera = read_camera(folder / "camera.yaml")
    if camera.width < 1 or camera.height_px < 1 or camera.width * camera.height_px > 10**9:
        raise Wrong(f"a camera of {camera.width} x {camera.height_px}")
    return camera


def grid_of(folder: Path, files: Files) -> Any:
    """Cells and boxes."""
    return read_occupancy(folder / "map.yaml"), read_grid(folder / "map.yaml")


def recording_of(folder: Path, files: Files) -> Any:
    """Every image and pose of a recording."""
    log = folder
    if "log.bag" in files:
        log = folder / "log.bag"
    elif any(name.startswith("bag/") for name in files):
        log = folder / "bag"
    recording = open_recording(str(log))
    read_all(recording)
    recording.digest()
    return recording.odometry


def read_all(recording: Recording) -> None:
    """Every image and scan of a recording."""
    if not (np.diff(recording.stamps) > 0).all():
        raise Wrong("stamps do not ascend")
    for frame in range(len(recording.stamps)):
        recording.image(frame)
        recording.scan(frame)
    not_finite(recording.camera, "camera")


def image_of(folder: Path, files: Files) -> Any:
    """An image, as of a goal and as of a message."""
    try:
        pixels = decode_image(files["goal.png"])
    except Undecodable as error:
        raise BadInput(str(error)) from None
    if pixels.shape != read_image(folder / "goal.png").shape:
        raise Wrong("two images in one file")


def another_size(random: Random, files: Files) -> Files:
    """An image that says it has another size, its checksum right."""
    name = random.choice(sorted(name for name in files if name.endswith((".png", ".jpg", ".pgm"))))
    data = bytearray(files[name])
    width, height = random.choice(SIZES) % 2**32, random.choice(SIZES) % 2**32
    if data.startswith(b"\x89PNG"):
        data[16:24] = struct.pack(">II", width, height)
        data[29:33] = struct.pack(">I", zlib.crc32(data[12:29]))
    elif data.startswith(b"P") and data.count(b"\n") > 2:
        head, _, rest = bytes(data).split(b"\n", 2)
        data = bytearray(b"\n".join([head, b"%d %d" % (width, height), rest]))
    elif b"\xff\xc0" in data:
        at = data.index(b"\xff\xc0") + 5
        data[at : at + 4] = struct.pack(">HH", height % 2**16, width % 2**16)
    return files | {name: bytes(data)}


def more_scans(random: Random, files: Files) -> Files:
    """A JPEG with its scans many times over."""
    name = random.choice(sorted(files))
    data = files[name]
    at = data.find(b"\xff\xda")
    if at < 0 or len(data) > 10_000:
        return files
    return files | {name: data[:at] + data[at:-2] * random.choice((2, 30, 3000)) + b"\xff\xd9"}


def sqlite_rows(random: Random, files: Files) -> Files:
    """Damaged rows in a whole SQLite file."""
    name = next((name for name in sorted(files) if name.endswith(".db3")), None)
    if name is None:
        return on(BINARY)(random, files)
    with tempfile.NamedTemporaryFile(suffix=".db3") as scratch:
        scratch.write(files[name])
        scratch.flush()
        value: Any = random.choice((None, -1, 2**63 - 1, "x", b"", b"\xff" * 40, 1e308, "a/msg/B", ""))
        table, column = random.choice(COLUMNS)
        try:
            with sqlite3.connect(scratch.name) as base:
                rows = [row for (row,) in base.execute(f"SELECT rowid FROM {table}")]
                base.execute(f"UPDATE {table} SET {column}=? WHERE rowid=?", (value, random.choice(rows)))
        except (sqlite3.Error, IndexError):
            return files
        finally:
            base.close()
        return files | {name: Path(scratch.name).read_bytes()}


CAMERA = Format("camera.yaml", cameras, [on(TEXT)], camera_of, cases=400)
GRID = Format("grid", grids, [on(TEXT, ".yaml"), on(TEXT, ".yaml"), on(BINARY, ".pgm", ".png"), another_size], grid_of)
TABLE = Format("layout and table", folders, [on(TEXT, ".csv"), on(TEXT, ".yaml")], recording_of, cases=300)
FOLDER = Format("image folder", folders, [on(BINARY), on(BINARY, ".jpg"), another_size], recording_of)
IMAGE = Format(
    "image and goal", images, [on(BINARY), on(BINARY), another_size, more_scans], image_of, cases=400, may_crash=True
)
BAG = Format("rosbag", bags, [on(BINARY), on(BINARY), on(TEXT, ".yaml", ".bag"), sqlite_rows], recording_of, cases=60)
