"""Image files: their size is known before they are decoded, and bounds what is."""

import struct
import zlib

import cv2
import numpy as np
import pytest

from omninav.stages.values.encoded_image import Undecodable, decode_image, size_of

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
    assert size_of(b"P5\n# a comment\n20 # and one more\n12\n255\n") == (20, 12)


@pytest.mark.parametrize(("width", "height"), [(30_000, 30_000), (2**31 - 1, 1), (0, 4), (2**32 - 1, 2**32 - 1)])
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
