"""Thumbnails of a map's references, kept beside it."""

from typing import Annotated

import cv2

from omninav.pipeline import Shape, Starts, Value
from omninav.stages.geometry.arrays import Bytes, Ints

from .encoded_image import decode_image
from .image import Pixels


class Thumbnails(Value):
    """A small image of each reference of a map, in the map's order.

    `jpegs`: their JPEG bytes one after the other; image n is from `ends[n]` to `ends[n + 1]`; empty: missing.
    """

    jpegs: Annotated[Bytes, Shape("bytes")]
    ends: Annotated[Ints, Shape("N+1"), Starts("bytes")]

    def __len__(self) -> int:
        return len(self.ends) - 1

    def image(self, reference: int) -> Pixels:
        """The thumbnail of a reference: (rows, columns, 3), blue-green-red."""
        return decoded(self.jpegs[self.ends[reference] : self.ends[reference + 1]])


def encoded(pixels: Pixels, quality: int = 80) -> bytes:
    """JPEG bytes of an image (rows, columns, 3), blue-green-red; `quality` in per cent."""
    return cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes()


def decoded(jpeg: bytes | Bytes) -> Pixels:
    """Decode an image from JPEG bytes that were encoded here: (rows, columns, 3), blue-green-red."""
    return decode_image(bytes(jpeg))
