"""Videos as logs: any container that OpenCV reads, frame by frame, at the times that the container states."""

import hashlib
import os
import re
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import cv2
import numpy as np

from omninav.pipeline import digest_file, user_path
from omninav.stages.camera.model import Camera
from omninav.stages.values.encoded_image import MAX_PIXELS, Undecodable
from omninav.stages.values.image import Pixels

from .camera_yaml import write_camera
from .named_camera import assumed_camera, named_camera
from .recording import Format, OpenOptions, Recording, UnreadableRecording, checked_image
from .stamps import Stamps, ascending

MAX_FRAMES = 2_000_000
"""Largest accepted number of frames of a video: nine hours at 60 a second."""
CAPTURE_OPTIONS = "OPENCV_FFMPEG_CAPTURE_OPTIONS"
"""Environment variable with what OpenCV hands on to FFmpeg, as NAME;VALUE|NAME;VALUE."""
MAX_HIDDEN = 300
"""Frames of a trimmed video that are looked through for the first one that is shown: more than between key frames."""
MAX_REORDERED = 16.0
"""Largest time by which a frame is stored after a later one, in times between frames: H.264 allows 16."""
COMPARED, MIN_CHANGE = 6, 0.1
"""Frames at the beginning whose pixels are compared, and the median size of what is stored of them, as a share of the
first one's, above which they differ: a camera at rest makes 0.001."""
TOLERANCE_NS = 1_000_000
"""Between a frame's time as the container states it, and as the decoder does."""
MIN_STEPS, IRREGULAR, REACHED = 10, 1.5, 0.9
"""Frames come less often than the stated rate says if the median of at least `MIN_STEPS` intervals is `IRREGULAR` times
as long. Such a video is whole if its last frame, which is shown for a while, is beyond `REACHED` of its length."""
CONTAINERS = re.compile(
    rb"....(?:ftyp|moov|mdat|wide|free|skip|pnot)|RIFF....AVI |\x1aE\xdf\xa3|\x47.{187}\x47"
    rb"|\x00\x00\x01\xba|OggS|FLV\x01",
    re.DOTALL,
)
"""First bytes of MP4, MOV, AVI, Matroska, WebM, MPEG-TS and -PS, Ogg and FLV: FFmpeg would also follow playlists."""


class VideoRecording(Recording):
    """The frames of a video as a `Recording`; it has neither odometry nor positions. Stamps count from its beginning.

    Images are decoded one after another; one before the last that was asked for is reached from the beginning, so that
    the same number always gives the same image. Rotation metadata is obeyed. Counted in `dropped`: `missing_frame`
    (fewer than the container states), `duplicate_frame`, `backward_stamp`, and when images are read
    `undecodable_image`, `blank_image`. Raises `UnreadableRecording`.
    """

    def __init__(self, name: str, path: Path, options: OpenOptions) -> None:
        super().__init__()
        self.name, self._path = name, path
        self._capture = _opened(path)
        width, height = (int(self._capture.get(cv2.CAP_PROP_FRAME_WIDTH + axis)) for axis in (0, 1))
        if not 0 < width * height <= MAX_PIXELS:
            raise UnreadableRecording(f"{name}: {width} x {height} pixels, at most {MAX_PIXELS:,} are read")
        if _is_unconverted(path):
            raise UnreadableRecording(
                f"{name}: its frames stay the same while what is stored changes: they are interlaced, or it holds "
                "several tracks; write one that is progressive: "
                f"`ffmpeg -i {path.name} -map 0:v:0 -vf yadif -c:v libx264 progressive.mp4`"
            )
        hidden, times = self._hidden(), _presentation_times(path)
        stated = _stated(self._capture, times)
        self.stamps = self._in_order(times)[hidden:]
        self.stamps -= self.stamps[0] if len(self.stamps) else 0
        stated -= hidden
        if stated > len(self.stamps) and stated < MAX_FRAMES and not self.dropped:
            self._drop(
                "missing_frame",
                f"{int(stated)} frames are stated, {len(self.stamps)} found",
                int(stated) - len(self.stamps),
            )
        if not len(self.stamps):
            raise UnreadableRecording(f"{name}: no frame can be read; is the file whole? {_repair(path)}")
        self._next = self._grabbed = 0
        self._ahead: int | None = None
        self._is_numbered = self._capture.grab() and abs(_position(self._capture)) > TOLERANCE_NS
        self._capture = _opened(path)
        self.camera = self._camera(options.camera)

    def image(self, frame: int, following: Sequence[int] = ()) -> Pixels | None:
        """The image of a frame; None (and counted) where it cannot be decoded or is blank."""
        where = f"frame {frame} at {self.stamps[frame] / 1e9:.3f} s"
        return checked_image(partial(self._decoded, frame), where, self.camera, self._drop)

    def digest(self) -> str:
        """sha256 over the file and the camera."""
        return hashlib.sha256((digest_file(self._path) + write_camera(self.camera)).encode()).hexdigest()

    def _decoded(self, frame: int) -> Pixels:
        """The frame at a stamp, by reading on until the decoder is there; `Undecodable` where it passes over it."""
        target = int(self.stamps[frame])
        if frame < self._next:
            self._capture, self._ahead, self._grabbed = _opened(self._path), None, 0
        self._next = frame + 1
        while self._ahead is None or self._ahead < target - TOLERANCE_NS:
            if not self._capture.grab():
                raise Undecodable("it cannot be decoded")
            self._ahead = self._next_time()
        pixels = None if self._ahead > target + TOLERANCE_NS else self._capture.retrieve()[1]
        if pixels is None:
            raise Undecodable("it cannot be decoded")
        return np.asarray(pixels, np.uint8)

    def _next_time(self) -> int:
        """Time (ns) of the frame that the decoder gave last. An AVI states none: there the n-th frame has the n-th."""
        self._grabbed += 1
        if self._is_numbered and self._grabbed <= len(self.stamps):
            return int(self.stamps[self._grabbed - 1])
        return _position(self._capture)

    def _hidden(self) -> int:
        """Counts the stored frames before the first that is shown: a trimmed video begins between two key frames."""
        is_shown, first = _opened(self._path).read()
        every = _opened(self._path, ignoring_edits=True)
        for number in range(MAX_HIDDEN if is_shown else 0):
            is_stored, pixels = every.read()
            if is_stored and np.array_equal(pixels, first):
                return number
        return 0

    def _in_order(self, times: list[int]) -> Stamps:
        kept, repeated, _ = ascending(sorted(times))  # packets come in the order of decoding
        for number in repeated:
            self._drop("duplicate_frame", f"two frames at {sorted(times)[number] / 1e9:.3f} s")
        return np.array(sorted(times), np.int64)[kept]

    def _camera(self, named: str | None) -> Camera:
        try:
            first = self._decoded(0)
        except Undecodable:
            message = f"{self.name}: its first frame cannot be decoded; {_repair(self._path)}"
            raise UnreadableRecording(message) from None
        height, width = first.shape[:2]
        beside = self._path.parent / "camera.yaml"
        if named is not None or beside.is_file():
            camera, files = named_camera(named or str(beside), lambda: (width, height))
            if (camera.width, camera.height_px) != (width, height):
                raise UnreadableRecording(
                    f"{files[0]}: it is of images of {camera.width} x {camera.height_px}, and those of {self.name} are "
                    f"{width} x {height}; name their own: camera=FILE"
                )
            return camera
        camera, sentence = assumed_camera(self.name, first)
        self.assumed = (sentence,)
        return camera

    def _drop(self, kind: str, detail: str, number: int = 1) -> None:
        self.drop(kind, f"{self.name}: {detail}", number)


class Video(Format):
    """A video file."""

    names = "a video (.mp4, .mov, .avi, .mkv, .webm)"
    suffixes = (".mp4", ".mov", ".m4v", ".avi", ".mkv", ".webm", ".insv", ".mts", ".ts", ".ogv")

    def opens(self, log: str) -> bool:
        """A file with one of the suffixes, in small letters or capitals."""
        return Path(log).suffix.lower() in self.suffixes and not user_path(log).is_dir()

    def open(self, log: str, options: OpenOptions) -> VideoRecording:
        """Opens a video with OpenCV's FFmpeg. Raises `UnreadableRecording`."""
        return VideoRecording(log, user_path(log), options)


def _opened(path: Path, packets: bool = False, ignoring_edits: bool = False) -> cv2.VideoCapture:
    """A video at its beginning; `packets`: as it is stored, nothing is decoded; `ignoring_edits`: from the first frame
    that is stored, shown or not."""
    if not path.is_file():
        raise UnreadableRecording(f"{path}: this is a folder, a pipe or a device, expected a video")
    try:
        with path.open("rb") as file:
            head = file.read(189)
    except OSError as error:
        raise UnreadableRecording(f"{path}: {error.strerror}; name a video that can be read") from None
    if not CONTAINERS.match(head):
        raise UnreadableRecording(f"{path}: this is no video, expected MP4, MOV, AVI, MKV, WebM, MPEG or Ogg")
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")  # no messages: frames without a picture are counted
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    options = os.environ.get(CAPTURE_OPTIONS, "")
    if ignoring_edits:
        os.environ[CAPTURE_OPTIONS] = "|".join(filter(None, (options, "ignore_editlist;1")))
    capture = cv2.VideoCapture(str(path.absolute()), cv2.CAP_FFMPEG, [cv2.CAP_PROP_FORMAT, -1] if packets else [])
    os.environ[CAPTURE_OPTIONS] = options
    if not capture.isOpened():
        raise UnreadableRecording(
            f"{path}: no video can be read from it; it holds sound alone, or was cut off before its index was written, "
            f"which `untrunc WHOLE.mp4 {path.name}` restores from a whole video of the same camera"
        )
    return capture


def _presentation_times(path: Path) -> list[int]:
    """Times (ns) at which the frames that a video stores are to be shown, trimmed away or not, as they are stored."""
    capture = _opened(path, packets=True, ignoring_edits=True)
    times: list[int] = []
    while capture.grab():
        times.append(_position(capture))
        if len(times) > MAX_FRAMES:
            raise UnreadableRecording(f"{path}: more than {MAX_FRAMES:,} frames; cut it into several videos")
    steps = np.diff(np.unique(times))
    if len(steps) and (again := np.maximum.accumulate(times) - times > MAX_REORDERED * np.median(steps)).any():
        raise UnreadableRecording(
            f"{path}: its times begin again at frame {int(again.argmax())}, as of parts that were joined: "
            "give the parts, log=[FIRST,SECOND]"
        )
    return times


def _stated(capture: cv2.VideoCapture, times: list[int]) -> float:
    """Number of frames that a video should have. Only MP4 stores it; elsewhere OpenCV gives length times rate, too many
    where frames come less often: then as many as fit, or all of these `times` (ns) if they reach the end."""
    stated, rate = capture.get(cv2.CAP_PROP_FRAME_COUNT), capture.get(cv2.CAP_PROP_FPS)
    steps = np.diff(np.unique(times)) / 1e9
    if len(steps) < MIN_STEPS or rate <= 0.0 or np.median(steps) < IRREGULAR / rate:
        return float(stated)
    return float(len(times) if max(times) / 1e9 >= REACHED * stated / rate else stated / rate // np.median(steps))


def _position(capture: cv2.VideoCapture) -> int:
    return round(capture.get(cv2.CAP_PROP_POS_MSEC) * 1e6)


def _is_unconverted(path: Path) -> bool:
    """Tells whether the first frames are equal to the last bit, though what is stored of them is not small: FFmpeg
    leaves interlaced ones unconverted, and what was in memory before comes instead."""
    decoded, stored = _opened(path), _opened(path, packets=True)
    frames = [decoded.read()[1] for _ in range(COMPARED)]
    packets = [packet for packet in (stored.read()[1] for _ in range(COMPARED)) if packet is not None]
    if not packets or not all(frame is not None and np.array_equal(frame, frames[0]) for frame in frames):
        return False
    is_large = float(np.median([packet.size for packet in packets])) > MIN_CHANGE * packets[0].size
    return is_large and not all(np.array_equal(packet, packets[0]) for packet in packets)


def _repair(path: Path) -> str:
    return f"`ffmpeg -i {path.name} -c:v libx264 readable.mp4` writes what FFmpeg can decode of it"
