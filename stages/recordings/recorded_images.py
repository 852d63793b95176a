"""The images of a drive as they were taken: what a program is given that is no part of this one."""

from typing import Annotated

from omninav.pipeline import Shape, Starts, Value
from omninav.stages.geometry.arrays import Array, Bytes, Ints


class RecordedImages(Value):
    """N images in the order of their times, all of one camera, with what is known of each.

    `camera`: its camera.yaml. `pngs`: their PNG bytes one after the other; image n is from `ends[n]` to `ends[n +
    1]`. `stamps`: ns. `odometry` in its own frame and `truth` in the map's: x, y (m), heading (rad), a row of NaN
    where it is not known.
    """

    camera: str
    pngs: Annotated[Bytes, Shape("bytes")]
    ends: Annotated[Ints, Shape("N+1"), Starts("bytes")]
    stamps: Annotated[Ints, Shape("N")]
    odometry: Annotated[Array, Shape("N", 3, finite=False)]
    truth: Annotated[Array, Shape("N", 3, finite=False)]

    def __len__(self) -> int:
        return len(self.stamps)

    def png(self, row: int) -> bytes:
        """The bytes of an image's file."""
        return bytes(self.pngs[self.ends[row] : self.ends[row + 1]])
