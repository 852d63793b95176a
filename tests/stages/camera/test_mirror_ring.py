"""The ring of an uncalibrated mirror, found in its image."""

import math

import cv2
import numpy as np
import pytest
from conftest import DATA, needs_data
from made_rings import ring_picture

from omninav.pipeline.mcap.reader import LogReader
from omninav.stages.camera.mirror_ring import RingNotFound, find_ring


@pytest.mark.parametrize("seed", range(3))
def test_the_ring_is_found_in_the_image(seed: int) -> None:
    rng = np.random.default_rng(seed)
    centre = (320 + rng.uniform(-40, 40), 240 + rng.uniform(-15, 15))
    outer, inner = rng.uniform(190, 215), rng.uniform(35, 60)
    x, y, found_inner, found_outer = find_ring(ring_picture(centre, outer, inner, seed))
    assert math.hypot(x - centre[0], y - centre[1]) < 3.0
    assert outer - 6.0 < found_outer < outer  # within the rim, and outside of the camera's reflection
    assert inner < found_inner < inner + 6.0


CALIBRATION = [(f"catadioptric-calibration/omnidir_images/{n}.jpg", (631, 437, 67, 525)) for n in range(1, 19)]
ALVIN = [
    (f"catadioptric-alvin-robot/{name}_{width}_{width * 3 // 4}.jpg", tuple(share * width for share in ring))
    for name, widths, ring in (
        ("calib", (640, 800, 1024, 2592), (0.4885, 0.4005, 0.1130, 0.3325)),
        ("calib_floor", (800, 2592), (0.4710, 0.3955, 0.1130, 0.3325)),
    )
    for width in widths
]


@needs_data
@pytest.mark.parametrize(("name", "ring"), CALIBRATION + ALVIN, ids=lambda value: str(value).split("/")[-1])
def test_the_ring_is_found_in_every_real_mirror_image(name: str, ring: tuple[float, float, float, float]) -> None:
    # Where the circles were laid by eye over the pictures, to about 1 % of their width: one camera each, that stands
    # still. Its rim is cut off above in the calibration pictures, and a plain wall behind it is as grey as its picture.
    pixels = cv2.imread(str(DATA / name))
    assert pixels is not None, name
    assert np.abs(np.subtract(find_ring(pixels), ring)).max() < 0.015 * pixels.shape[1]


@needs_data
def test_the_ring_of_the_photoreal_mirror_is_its_mask_in_the_camera_file() -> None:
    reader = LogReader(DATA / "photoreal-house" / "drive.mcap")
    first = next(reader.messages(["/camera/image/compressed"]))
    pixels = cv2.imdecode(np.frombuffer(first.content.data, np.uint8), cv2.IMREAD_COLOR)
    assert np.allclose(find_ring(pixels), (319.5, 239.5, 34, 238), atol=6)


def test_an_image_without_a_ring_says_so() -> None:
    noise = np.random.default_rng(0).integers(0, 256, (480, 640, 3), dtype=np.uint8)
    for pixels in (np.full((480, 640, 3), 90, np.uint8), noise, cv2.GaussianBlur(noise, (0, 0), 8)):
        with pytest.raises(RingNotFound):
            find_ring(pixels.astype(np.uint8))
