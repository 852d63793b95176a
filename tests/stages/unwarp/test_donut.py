"""The ring of an uncalibrated mirror: found in the image, and kept."""

import math
from pathlib import Path

import cv2
import numpy as np
import pytest

from omninav.pipeline import BadInput, Context, Tick
from omninav.pipeline.mcap.reader import LogReader
from omninav.stages.camera.cylindrical import Cylindrical
from omninav.stages.camera.donut import Donut
from omninav.stages.unwarp.donut import DonutUnwarp, DonutUnwrapState, RingNotFound, find_ring
from omninav.stages.values.image import Image, Pixels

DATA = Path(__file__).resolve().parents[4] / "shared" / "data"


def ring_picture(centre: tuple[float, float], outer: float, inner: float, seed: int) -> Pixels:
    rng = np.random.default_rng(seed)
    v, u = np.mgrid[0:480, 0:640]
    radius = np.hypot(u - centre[0], v - centre[1])
    texture = cv2.GaussianBlur(rng.integers(60, 256, (480, 640, 3), dtype=np.uint8), (0, 0), 3)
    pixels = np.where(((radius < outer) & (radius > inner))[..., None], texture, 12)
    return pixels.astype(np.uint8)


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


@pytest.mark.skipif(not DATA.is_dir(), reason=f"no sample data in {DATA}")
@pytest.mark.parametrize(("name", "ring"), CALIBRATION + ALVIN, ids=lambda value: str(value).split("/")[-1])
def test_the_ring_is_found_in_every_real_mirror_image(name: str, ring: tuple[float, float, float, float]) -> None:
    # Where the circles were laid by eye over the pictures, to about 1 % of their width: one camera each, that stands
    # still. Its rim is cut off above in the calibration pictures, and a plain wall behind it is as grey as its picture.
    pixels = cv2.imread(str(DATA / name))
    assert pixels is not None, name
    assert np.abs(np.subtract(find_ring(pixels), ring)).max() < 0.015 * pixels.shape[1]


def test_the_ring_of_the_photoreal_mirror_is_its_mask_in_the_camera_file() -> None:
    if not DATA.is_dir():
        pytest.skip(f"no sample data in {DATA}")
    reader = LogReader(DATA / "photoreal-house" / "drive.mcap")
    first = next(reader.messages(["/camera/image/compressed"]))
    pixels = cv2.imdecode(np.frombuffer(first.content.data, np.uint8), cv2.IMREAD_COLOR)
    assert np.allclose(find_ring(pixels), (319.5, 239.5, 34, 238), atol=6)


def test_an_image_without_a_ring_says_so() -> None:
    noise = np.random.default_rng(0).integers(0, 256, (480, 640, 3), dtype=np.uint8)
    for pixels in (np.full((480, 640, 3), 90, np.uint8), noise, cv2.GaussianBlur(noise, (0, 0), 8)):
        with pytest.raises(RingNotFound):
            find_ring(pixels.astype(np.uint8))


def test_each_log_has_a_ring_of_its_own() -> None:
    ctx, stage, found = Context("unwarp"), DonutUnwarp(), DonutUnwrapState()
    stage.setup(ctx)
    camera = Donut(640, 480)  # that two logs share a description does not make them one camera
    for log, centre in enumerate(((330, 236), (300, 250))):
        ctx.tick = Tick(log, log, log=log, first_of_log=True)
        stage.step(ctx, Image(ring_picture(centre, 200, 40, log)), camera, found)
        assert math.hypot(found.centre_x - centre[0], found.centre_y - centre[1]) < 3.0


def test_what_was_found_once_stays_for_all_images() -> None:
    ctx, stage, found = Context("unwarp"), DonutUnwarp(), DonutUnwrapState()
    stage.setup(ctx)
    camera = Donut(640, 480)
    stage.step(ctx, Image(ring_picture((330, 236), 200, 40, 0)), camera, found)
    first = (found.centre_x, found.centre_y, found.inner_radius_px, found.outer_radius_px)
    stage.step(ctx, Image(ring_picture((300, 250), 190, 50, 1)), camera, found)
    assert first == (found.centre_x, found.centre_y, found.inner_radius_px, found.outer_radius_px)
    # A later process that takes up the state without setup's memory makes the same panorama.
    again = DonutUnwarp()
    again.setup(ctx)
    picture = Image(ring_picture((330, 236), 200, 40, 2))
    one, other = (s.step(ctx, picture, camera, found).panorama for s in (stage, again))
    assert one is not None
    assert other is not None
    assert np.array_equal(one.pixels, other.pixels)


def test_a_camera_of_another_projection_is_refused_with_what_to_type() -> None:
    ctx, stage = Context("unwarp"), DonutUnwarp()
    stage.setup(ctx)
    with pytest.raises(BadInput, match="camera is cylindrical, not donut; use unwarp=panorama"):
        stage.step(ctx, Image(np.zeros((25, 120, 3), np.uint8)), Cylindrical(120, 25, 60.0), DonutUnwrapState())
