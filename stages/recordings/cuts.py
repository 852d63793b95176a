"""A log whose middle is cut out: to the robot it is as if somebody had carried it over that part of its way."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from omninav.stages.geometry.plane.se2 import between, compose

from .recording import UnreadableRecording

Array = npt.NDArray[np.float64]
Splice = tuple[int, int]


def check_splices(splices: Sequence[Splice], frames: int, name: str) -> None:
    """Raise UnreadableRecording where a splice does not lead onwards within a log of so many frames."""
    end = 0
    for after, to in splices:
        if not end < after < to < frames:
            raise UnreadableRecording(
                f"{name}: the splice [{after}, {to}] does not lead onwards between {end} and {frames - 1}; type "
                "splices=[[60,300]] to go on with picture 300 once the first 60 are through"
            )
        end = to


def spliced_frames(splices: Sequence[Splice], frames: int) -> npt.NDArray[np.int64]:
    """Numbers of the frames that are left."""
    kept = np.ones(frames, np.bool_)
    for after, to in splices:
        kept[after:to] = False
    return np.flatnonzero(kept)


def crossed(splices: Sequence[Splice], frames: npt.NDArray[np.int64]) -> npt.NDArray[np.bool_]:
    """Whether a splice lies between each of the frames (N,) and the next: (N - 1,)."""
    done = np.searchsorted([to for _, to in splices], frames, side="right")
    between_them: npt.NDArray[np.bool_] = np.diff(done) > 0
    return between_them


def as_if_driven(poses: Array, splices: Sequence[Splice]) -> Array:
    """Poses (N, 3) as an odometry gives them that knows nothing of the splices.

    What was measured on the way from picture `to - 1` to picture `to` is measured from the last one before the splice.
    """
    told = poses.copy()
    for after, to in splices:
        moved = between(told[to - 1], told[to:])
        told[to:] = compose(told[after - 1], moved)
    return told
