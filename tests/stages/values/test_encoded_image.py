"""Image files: their size is known before they are decoded, and bounds what is."""

import struct
import zlib

import cv2
import numpy as np
import pytest

from omninav.stages.values.encoded_image import Undecodable, decode_image, orientation_of, size_of

PIXELS = np.random.default_rng(0).integers(0, 256, (12, 20, 3), dtype=np.uint8)


def encoded(suffix: str, *options: int) -> bytes:
    return bytes(cv2.imencode(suffix, PIXELS, options)[1])


def png_saying(width: int, height: int) -> bytes:
    """A PNG with another size in its head and a checksum that fits."""
    data = bytearray(encoded(".png"))
    data[16:24] = struct.pack(">II", width, height)
    data[29:33] = struct.pack(">I", zlib.crc32(data[12:29]))
    return bytes(data)


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".bmp", ".ppm", ".tiff", ".webp"])
def test_the_size_in_the_head_is_that_of_the_decoded_image(suffix: str):
    data = encoded(suffix)
    assert size_of(data) == (20, 12)
    assert decode_image(data).shape == (12, 20, 3)
    assert decode_image(data, colour=False).shape == (12, 20)


def test_the_size_of_a_progressive_jpeg_and_of_a_lossless_webp_is_read():
    assert size_of(encoded(".jpg", cv2.IMWRITE_JPEG_PROGRESSIVE, 1)) == (20, 12)
    assert size_of(encoded(".webp", cv2.IMWRITE_WEBP_QUALITY, 101)) == (20, 12)
    lossless = b"RIFF....WEBPVP8L" + bytes(5)
    assert size_of(lossless + struct.pack("<I", 16383 << 14 | 0x1234) + bytes(9)) == (0x1235, 16384)
    assert size_of(b"P5\n# a comment\n20 # and one more\n12\n255\n") == (20, 12)


SKIPPED = b"".join(b"\xff%c\0\x0a\0\0\1\0\0\1\0\1" % marker for marker in (0xE0, 0xC4, 0xC8, 0xCC, 0xDB))
JPEG = b"\xff\xd8" + SKIPPED + b"\xff\1\xff\xd0\xff\xd8\xff\0\xff\xff\xc2\0\x0b\x08" + struct.pack(">HH", 300, 515)


@pytest.mark.parametrize(
    "head",
    [
        JPEG,
        b"BM" + bytes(12) + struct.pack("<IHH", 12, 515, 300),
        b"BM" + bytes(12) + struct.pack("<Iii", 40, 515, -300),
        b"RIFF....WEBPVP8 " + bytes(10) + struct.pack("<HH", 515 | 0x4000, 300 | 0x8000),
        b"RIFF....WEBPVP8X" + bytes(8) + b"\2\2\0" + b"\x2b\1\0",
        b"MM\0*" + struct.pack(">I2xHHHIHHHHII", 10, 2, 256, 3, 1, 515, 0, 257, 4, 1, 300),
    ],
)
def test_heads_that_opencv_does_not_write_say_their_size(head: bytes):
    assert size_of(head + bytes(9)) == (515, 300)


def with_exif(orientation: int, kind: int) -> bytes:
    """A JPEG with other segments before its EXIF, in which another entry stands first."""
    tags = struct.pack("<HHHIIHHIHH", 2, 0x010F, 3, 1, 7, 0x0112, kind, 1, orientation, 0)
    body, data = b"Exif\0\0II*\0\x08\0\0\0" + tags, encoded(".jpg")
    other = b"\xff\xe1\0\x0aother\0\0\0"
    return data[:2] + other + b"\xff\xe1" + struct.pack(">H", len(body) + 2) + body + data[2:]


@pytest.mark.parametrize("orientation", range(1, 9))
def test_a_jpeg_is_turned_as_its_exif_says_and_as_opencv_turns_it(orientation: int):
    data = with_exif(orientation, 3)
    assert orientation_of(data) == orientation
    expected = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    assert (decode_image(data) == expected).all()
    assert orientation_of(with_exif(orientation, 4)) == 1


@pytest.mark.parametrize("last", [False, True])
def test_a_png_is_turned_as_its_exif_says(last: bool):
    data, exif = encoded(".png"), with_exif(6, 3)[24:58]
    chunk = struct.pack(">I", len(exif)) + b"eXIf" + exif
    at = data.index(b"IEND" if last else b"IDAT") - 4
    turned = data[:at] + chunk + struct.pack(">I", zlib.crc32(chunk[4:])) + data[at:]
    assert orientation_of(turned) == 6
    assert (decode_image(turned) == np.rot90(decode_image(data), -1)).all()


@pytest.mark.parametrize(("width", "height"), [(8193, 4096), (2**31 - 1, 1), (0, 4), (2**32 - 1, 2**32 - 1)])
def test_an_image_that_says_it_is_too_large_is_not_decoded(width: int, height: int):
    with pytest.raises(Undecodable, match=f"{width} x {height} pixels, at most"):
        decode_image(png_saying(width, height))


def test_a_jpeg_of_very_many_scans_is_not_decoded():
    data = encoded(".jpg")
    scan = data.index(b"\xff\xda")
    with pytest.raises(Undecodable, match="scans"):
        decode_image(data[:scan] + data[scan:-2] * 100 + b"\xff\xd9")


@pytest.mark.parametrize("chunk", [b"IDAT", b"IEND"])
def test_a_png_whose_chunk_says_it_is_larger_than_the_file_is_not_decoded(chunk: bytes):
    data = bytearray(encoded(".png"))
    data[data.index(chunk) - 4] = 0x7F
    with pytest.raises(Undecodable, match="a PNG without its end"):
        decode_image(bytes(data))


@pytest.mark.parametrize("data", [b"", b"\xff\xd8\xff", b"BM", b"P5 9", b"MM\x00*\xff\xff\xff\xff", b"GIF89a" * 9])
def test_what_is_no_image_is_refused(data: bytes):
    with pytest.raises(Undecodable, match="bytes"):
        decode_image(data)


def test_twelve_bits_in_sixteen_are_refused_and_sixteen_are_not() -> None:
    pixels = np.random.default_rng(0).integers(0, 4096, (16, 32, 3)).astype(np.uint16)
    with pytest.raises(Undecodable, match="at most 12 of its 16 bits are used"):
        decode_image(cv2.imencode(".png", pixels)[1].tobytes())
    assert decode_image(cv2.imencode(".png", pixels * 16)[1].tobytes()).max() > 250
    assert not decode_image(cv2.imencode(".png", pixels * 0)[1].tobytes()).any()
