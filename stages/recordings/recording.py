"""Interface of every recording and of the formats that open one, and images that are decoded ahead."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

from omninav.pipeline import BadInput, user_path
from omninav.pipeline.mcap.message import BadMessage, Losses
from omninav.stages.camera.model import Camera
from omninav.stages.geometry.arrays import Array, Ints
from omninav.stages.values.encoded_image import Undecodable
from omninav.stages.values.image import Pixels
from omninav.stages.values.scan import Scan

from .messages import is_blank
from .plausibility import MotionLimits
from .stamps import TRUTH_MAX_GAP_S


class UnreadableRecording(BadInput):
    """A recording that cannot be used. The message is one line: which file, topic or record, and what to do."""


class Recording(Losses, ABC):
    """One recorded drive, its frames in the order of their header stamps.

    `name`: what the user wrote. `camera`: how its images are to be read. `stamps`: (N,) int64 header stamps in
    nanoseconds, strictly ascending, of the frames that can be used as far as is known without decoding an image.
    `odometry`: (N, 3) odometry pose at each stamp in the odometry's own frame, or None. `truth`: (N, 3) true pose in
    the map frame, rows of NaN where it is not known, or None. `dropped`: how many records were left out, by kind, and
    `details`: the first case of each kind in words. `unmeasured_s2`: (N,) squared lengths (s^2) up to each frame of
    gaps in which no odometry is believed, summed, or None where there are none. `assumed`: what nothing in it states
    and was assumed. `warnings`: what one must know of it to judge results.
    """

    name: str
    camera: Camera
    stamps: Ints
    odometry: Array | None = None
    unmeasured_s2: Array | None = None
    truth: Array | None = None
    assumed: Sequence[str] = ()
    warnings: Sequence[str] = ()

    @abstractmethod
    def image(self, frame: int, following: Sequence[int] = ()) -> Pixels | None:
        """The image of a frame, (height, width, 3) uint8 blue-green-red; None where it cannot be decoded or is blank.

        What is wrong with it is counted in `dropped` at that moment, under `undecodable_image` or `blank_image`.
        `following`: the frames that will be asked for next; some may be decoded in the meantime.
        """

    def scan(self, frame: int) -> Scan | None:
        """The last range readings at or before a frame; None where it has none."""

    @abstractmethod
    def digest(self) -> str:
        """sha256 over all content that the frames are made from."""


def checked_image(
    decode: Callable[[], Pixels], where: str, camera: Camera, drop: Callable[[str, str], None]
) -> Pixels | None:
    """The image that `decode` gives; None (and counted) where it cannot be decoded, is blank or of another size."""
    try:
        pixels = decode()
    except BadMessage as error:
        drop("bad_message", str(error))
        return None
    except (Undecodable, BadInput) as error:
        drop("undecodable_image", f"{where}: {error}")
        return None
    height, width = pixels.shape[:2]
    if (width, height) != (camera.width, camera.height_px):
        drop("wrong_size", f"{where} is {width} x {height}, the camera {camera.width} x {camera.height_px}")
        return None
    if is_blank(pixels):
        drop("blank_image", f"{where} is blank")
        return None
    return pixels


@dataclass(frozen=True)
class Topics:
    """The topics to read. `image` null: `/camera/image/compressed`, else `/camera/image`. Others null: not read."""

    image: str | None = None
    camera_info: str | None = "/camera/camera_info"
    odometry: str | None = "/odom"
    truth: str | None = "/ground_truth/pose"
    scan: str | None = "/scan"


@dataclass(frozen=True)
class OpenOptions:
    """Settings of a user besides the recording's name."""

    topics: Topics = Topics()
    camera: str | None = None
    """A camera.yaml in place of the recording's own, or a projection that the size of an image describes."""
    layout_folders: tuple[str, ...] = ()
    """Folders with further descriptions of folders of images."""
    limits: MotionLimits = field(default_factory=MotionLimits)
    """Limits of the robot's motion."""
    rate: float | None = None
    """Images per second of a folder of images without times."""
    truth_max_gap_s: float = TRUTH_MAX_GAP_S
    """Largest time between an image and a pose on the topic of true poses, unless these come more seldom."""


FORMATS: list[type["Format"]] = []
"""The formats that were imported; see `opening.log_formats`."""


class Format(ABC):
    """A kind of log. A subclass is a format: which names it opens, and how."""

    names: ClassVar[str]
    """Name for people: "a .mcap file"."""
    suffixes: ClassVar[tuple[str, ...]] = ()
    """Endings of files that can be nothing else."""

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        FORMATS.append(cls)

    def opens(self, log: str) -> bool:
        """Tells whether a name is one of this format, there or not: by default a file with one of the suffixes."""
        return Path(log).suffix in self.suffixes and not user_path(log).is_dir()

    @abstractmethod
    def open(self, log: str, options: OpenOptions) -> Recording:
        """The recording. Raises `UnreadableRecording` or another `BadInput`."""


AHEAD = 4
"""Most images that are decoded before they are asked for."""


class DecodeAhead:
    """Decodes the images that will be asked for next while the caller works on the present one.

    `fetch` reads an image and returns what decodes it. It runs in the caller's thread, for a file has one reader at a
    time; what it returns runs in another, where OpenCV lets Python continue. An image, or the error that it raises, is
    the same whether or not it was expected, and comes when it is asked for.
    """

    def __init__(self, fetch: Callable[[int], Callable[[], Pixels]]) -> None:
        self._fetch = fetch
        self._thread: ThreadPoolExecutor | None = None
        self._coming: dict[int, Future[Pixels]] = {}

    def image(self, frame: int, following: Sequence[int] = ()) -> Pixels:
        """An image. `following`: the frames that will be asked for next, in their order."""
        decoded = self._coming.get(frame)
        self._coming = {after: self._coming.get(after) or self._begun(after) for after in following[:AHEAD]}
        return self._fetch(frame)() if decoded is None else decoded.result()

    def _begun(self, frame: int) -> Future[Pixels]:
        if self._thread is None:
            self._thread = ThreadPoolExecutor(1, "decode")
        try:
            return self._thread.submit(self._fetch(frame))
        except Exception as error:  # raised when the image is asked for
            failed: Future[Pixels] = Future()
            failed.set_exception(error)
            return failed
