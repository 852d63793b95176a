"""Thumbnails of a map's references, kept beside it."""

from typing import Annotated, cast

import cv2
import numpy as np
import numpy.typing as npt

from omninav.pipeline import Value
from omninav.pipeline.graph.contents import Shape, Starts

from .image import Pixels


class Thumbnails(Value):
    """A small image of each reference of a map, in the map's order.

    `jpegs`: their JPEG bytes one after the other; image n lies from `ends[n]` to `ends[n + 1]`; empty: missing.
    """

    jpegs: Annotated[npt.NDArray[np.uint8], Shape("bytes")]
    ends: Annotated[npt.NDArray[np.int64], Shape("N+1"), Starts("bytes")]

    def __len__(self) -> int:
        return len(self.ends) - 1

    def image(self, reference: int) -> Pixels:
        """The thumbnail of a reference: (rows, columns, 3), blue-green-red."""
        return decoded(self.jpegs[self.ends[reference] : self.ends[reference + 1]])


def decoded(jpeg: bytes | npt.NDArray[np.uint8]) -> Pixels:
    """Decode an image from JPEG bytes that were encoded here: (rows, columns, 3), blue-green-red."""
    content = np.frombuffer(jpeg, np.uint8) if isinstance(jpeg, bytes) else jpeg
    pixels = cv2.imdecode(content, cv2.IMREAD_COLOR)
    if pixels is None:
        raise ValueError("an image that was encoded here cannot be decoded")
    return cast(Pixels, pixels.astype(np.uint8, copy=False))
