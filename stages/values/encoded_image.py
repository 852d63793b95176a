"""Images as the bytes of a file: the size they state, and their pixels."""

import re
import struct
from collections.abc import Callable, Iterator
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from omninav.stages.geometry.arrays import Bytes

MAX_PIXELS = 1 << 25
"""Largest decoded image, pixels: an equirectangular image of 8000 x 4000 fits."""
MAX_FILE_BYTES = 100_000_000
"""Largest encoded image, bytes."""
MAX_SCANS = 64
"""Largest number of scans of a JPEG: a progressive one has some ten, and each costs as much as decoding the whole."""


PNG_DEPTH = 24
"""Byte of a PNG that states its bits per channel."""
EXIF_BYTES = 4096
"""Largest part of a JPEG or PNG in which its EXIF orientation is looked for, bytes."""
_TURNS: dict[int, Callable[[npt.NDArray[Any]], npt.NDArray[Any]]] = {
    2: lambda pixels: pixels[:, ::-1],
    3: lambda pixels: pixels[::-1, ::-1],
    4: lambda pixels: pixels[::-1],
    5: lambda pixels: pixels.swapaxes(0, 1),
    6: lambda pixels: pixels[::-1].swapaxes(0, 1),
    7: lambda pixels: pixels[::-1, ::-1].swapaxes(0, 1),
    8: lambda pixels: pixels[:, ::-1].swapaxes(0, 1),
}
"""Turns that put an image of each EXIF orientation upright."""


class Undecodable(ValueError):
    """Bytes that are no image; the message states what is wrong with them."""


def decode_image(data: bytes, colour: bool = True, max_pixels: int = MAX_PIXELS) -> Bytes:
    """An image file's bytes as (height, width, 3) uint8 blue-green-red, or (height, width) without `colour`.

    A JPEG or PNG is turned as its EXIF orientation states, as of a camera that was held on its side.
    JPEG, PNG, BMP, PNM, WebP and TIFF. Raises `Undecodable`; before anything is unpacked where the file states that it
    is larger than `max_pixels`; also for a JPEG or PNG that was cut off, whose missing part OpenCV would fill with
    grey.
    """
    width, height = size_of(data)
    if not 0 < width * height <= max_pixels or min(width, height) < 1:
        raise Undecodable(f"{width} x {height} pixels, at most {max_pixels:,} are read")
    if data.startswith(b"\xff\xd8") and b"\xff\xd9" not in data[-4096:]:
        raise Undecodable("a JPEG without its end")
    if data.startswith(b"\xff\xd8") and data.count(b"\xff\xda") > MAX_SCANS:
        raise Undecodable(f"a JPEG of more than {MAX_SCANS} scans")
    if data.startswith(b"\x89PNG") and not _png_is_whole(data):
        raise Undecodable("a PNG without its end")
    flags = (cv2.IMREAD_COLOR if colour else cv2.IMREAD_GRAYSCALE) | cv2.IMREAD_IGNORE_ORIENTATION
    try:
        pixels = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    except cv2.error as error:
        raise Undecodable(" ".join(str(error.err or error).split())[:200]) from None
    if pixels is None:
        raise Undecodable(f"{len(data)} bytes that are no image OpenCV knows")
    if data.startswith(b"\x89PNG") and data[PNG_DEPTH] == 16 and 0 < pixels.max() < 16:
        raise Undecodable("at most 12 of its 16 bits are used; `mogrify -evaluate multiply 16 -depth 8 *.png` writes 8")
    turn = _TURNS.get(orientation_of(data))
    return np.asarray(pixels if turn is None else np.ascontiguousarray(turn(pixels)), dtype=np.uint8)


def orientation_of(data: bytes) -> int:
    """The orientation that the beginning of a JPEG or PNG file states in its EXIF, 1 to 8; 1, as it is, where it has
    none.

    Exif 2.32 (CIPA DC-008), tag 0x0112; PNG third edition, 11.3.3.5.
    """
    try:
        entries = _entries(_exif(data), 0x0112)
        return next((value for _, kind, value in entries if kind == 3), 1)
    except (IndexError, struct.error):
        return 1


def _exif(data: bytes) -> bytes:
    at = 8
    while data.startswith(b"\x89PNG") and at < len(data):
        if data[at + 4 : at + 8] == b"eXIf":
            return data[at + 8 : at + 8 + EXIF_BYTES]
        at += 12 + struct.unpack_from(">I", data, at)[0]
    at = 2
    while data.startswith(b"\xff\xd8") and data[at] == 0xFF and data[at + 1] != 0xDA:
        if data[at + 1] == 0xE1 and data[at + 4 : at + 10] == b"Exif\0\0":
            return data[at + 10 : at + 10 + EXIF_BYTES]
        at += 2 + struct.unpack_from(">H", data, at + 2)[0]
    return b""


def size_of(data: bytes) -> tuple[int, int]:
    """Width and height (pixels) that an image file states in its head. Raises `Undecodable`."""
    read = next((read for start, read in _KINDS if re.match(start, data, re.DOTALL)), None)
    if read is None:
        raise Undecodable(f"{len(data)} bytes that are no JPEG, PNG, BMP, PNM, WebP or TIFF")
    try:
        return read(data)
    except (struct.error, KeyError, ValueError):
        raise Undecodable(f"{len(data)} bytes of an image that does not state its size") from None


def _png(data: bytes) -> tuple[int, int]:
    width, height = struct.unpack_from(">II", data, 16)
    return width, height


def _png_is_whole(data: bytes) -> bool:
    """Tells whether every chunk up to the end is there: OpenCV makes room for as many bytes as a chunk states."""
    at = 8
    while at + 12 <= len(data):
        kind = data[at + 4 : at + 8]
        at += 12 + int.from_bytes(data[at : at + 4], "big")
        if kind == b"IEND":
            return at <= len(data)
    return False


def _jpeg(data: bytes) -> tuple[int, int]:
    at = 2
    while 0 <= (at := data.find(b"\xff", at)) <= len(data) - 4:  # OpenCV, too, looks for the next marker
        marker, (length,) = data[at + 1], struct.unpack_from(">H", data, at + 2)
        if 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):
            height, width = struct.unpack_from(">HH", data, at + 5)
            return width, height
        at += 1 if marker == 0xFF else 2 if marker in (0x00, 0x01, *range(0xD0, 0xD9)) else 2 + max(length, 2)
    raise ValueError


def _bmp(data: bytes) -> tuple[int, int]:
    if struct.unpack_from("<I", data, 14)[0] == 12:
        width, height = struct.unpack_from("<HH", data, 18)
    else:
        width, height = struct.unpack_from("<ii", data, 18)
    return abs(width), abs(height)


def _pnm(data: bytes) -> tuple[int, int]:
    words = re.match(rb"P[1-6](?:\s+(?:#[^\n]*\n\s*)*)(\d{1,9})(?:\s+(?:#[^\n]*\n\s*)*)(\d{1,9})\s", data[:4096])
    if words is None:
        raise ValueError
    return int(words[1]), int(words[2])


def _webp(data: bytes) -> tuple[int, int]:
    kind = data[12:16]
    if kind == b"VP8X":
        return 1 + int.from_bytes(data[24:27], "little"), 1 + int.from_bytes(data[27:30], "little")
    if kind == b"VP8L":
        bits = int.from_bytes(data[21:25], "little")
        return 1 + (bits & 0x3FFF), 1 + (bits >> 14 & 0x3FFF)
    width, height = struct.unpack_from("<HH", data, 26)
    return width & 0x3FFF, height & 0x3FFF


def _tiff(data: bytes) -> tuple[int, int]:
    sizes = {tag: value for tag, _, value in _entries(data, 256, 257)}
    return sizes[256], sizes[257]


def _entries(data: bytes, *tags: int) -> Iterator[tuple[int, int, int]]:
    """Tag, type and number of those entries in the first directory of a TIFF file, such as EXIF, that have the tags."""
    order = "<" if data.startswith(b"II") else ">"
    (at,) = struct.unpack_from(f"{order}I", data, 4)
    for number in range(min(struct.unpack_from(f"{order}H", data, at)[0], 200)):
        tag, kind = struct.unpack_from(f"{order}HH", data, at + 2 + 12 * number)
        if tag in tags:
            (value,) = struct.unpack_from(f"{order}{'H' if kind == 3 else 'I'}", data, at + 10 + 12 * number)
            yield tag, kind, value


_KINDS: tuple[tuple[bytes, Callable[[bytes], tuple[int, int]]], ...] = (
    (rb"\x89PNG\r\n\x1a\n", _png),
    (rb"\xff\xd8\xff", _jpeg),
    (rb"BM", _bmp),
    (rb"P[1-6]\s", _pnm),
    (rb"RIFF....WEBP", _webp),
    (rb"II\*\x00|MM\x00\*", _tiff),
)
"""First bytes of files of each kind, and readers of their size."""
