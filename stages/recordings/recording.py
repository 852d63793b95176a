"""What every kind of recording offers to the source stage: frames with stamps, odometry and perhaps truth."""

from collections import Counter
from typing import Protocol

import numpy as np
import numpy.typing as npt

from omninav.pipeline.graph.problems import BadInput
from omninav.stages.camera.model import Camera
from omninav.stages.values.image import Pixels
from omninav.stages.values.scan import Scan

Array = npt.NDArray[np.float64]


class UnreadableRecording(BadInput):
    """A recording that cannot be used. The message is one line: which file, topic or record, and what to do."""


class Recording(Protocol):
    """One recorded drive, its frames in the order of their header stamps.

    `name`: what the user wrote. `camera`: how its pictures are to be read. `stamps`: (N,) int64 header stamps in
    nanoseconds, strictly ascending, of the frames that can be used as far as is known without decoding a picture.
    `odometry`: (N, 3) odometry pose at each stamp in the odometry's own frame, or None. `truth`: (N, 3) true pose in
    the map frame, rows of NaN where it is not known, or None. `dropped`: how many records were left out, by kind, and
    `details`: the first case of each kind in words.
    """

    @property
    def name(self) -> str: ...
    @property
    def camera(self) -> Camera: ...
    @property
    def stamps(self) -> npt.NDArray[np.int64]: ...
    @property
    def odometry(self) -> Array | None: ...
    @property
    def truth(self) -> Array | None: ...
    @property
    def dropped(self) -> Counter[str]: ...
    @property
    def details(self) -> dict[str, str]: ...

    def image(self, frame: int) -> Pixels | None:
        """The picture of a frame, (height, width, 3) uint8 blue-green-red; None where it cannot be decoded or is blank.

        What is wrong with it is counted in `dropped` at that moment, under `undecodable_image` or `blank_image`.
        """

    def scan(self, frame: int) -> Scan | None:
        """The last range readings at or before a frame; None where it has none."""

    def digest(self) -> str:
        """sha256 over all content that the frames are made from."""
