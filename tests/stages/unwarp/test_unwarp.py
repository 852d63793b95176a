import math
from pathlib import Path

import cv2
import numpy as np
import pytest

from omninav.pipeline import Context, Stage, Tick
from omninav.pipeline.graph.problems import BadInput
from omninav.pipeline.mcap.log import LogReader
from omninav.stages.camera.models import (
    Camera,
    Cylindrical,
    Donut,
    Equirectangular,
    Fisheye,
    HyperbolicMirror,
    Perspective,
)
from omninav.stages.unwarp.by_camera import UnwarpByCamera
from omninav.stages.unwarp.donut import DonutUnwarp, DonutUnwrapState, RingNotFound, find_ring
from omninav.stages.unwarp.hyperbolic import HyperbolicUnwarp, elevation_range
from omninav.stages.unwarp.strip import StripUnwarp
from omninav.stages.values.image import Image, Panorama, Pixels, column_azimuths

DATA = Path(__file__).resolve().parents[4] / "shared" / "data"
MIRROR = HyperbolicMirror(640, 480, 497.0, 497.0, 319.5, 239.5, 28.095, 23.4125, 34.0, 238.0, yaw=0.3)


def unwarped(camera: Camera, pixels: Pixels, columns: int = 360, rows: int = 80) -> Panorama:
    ctx, stage = Context("unwarp"), UnwarpByCamera(columns=columns, rows=rows)
    stage.setup(ctx)
    return stage.step(ctx, Image(pixels), camera).panorama


def brightest_azimuth(panorama: Panorama) -> float:
    grey = panorama.pixels.sum(axis=(0, 2)).astype(float)
    weight = np.maximum(grey - grey.max() / 2, 0)
    azimuth = column_azimuths(len(grey))
    return math.atan2(float(weight @ np.sin(azimuth)), float(weight @ np.cos(azimuth)))


def spot(width: int, height: int, u: float, v: float) -> Pixels:
    pixels = np.zeros((height, width, 3), np.uint8)
    cv2.circle(pixels, (round(u), round(v)), 4, (255, 255, 255), -1)
    return pixels


@pytest.mark.parametrize("bearing", [0.0, 1.0, -2.0, 3.0])
@pytest.mark.parametrize(
    "camera",
    [
        MIRROR,
        Donut(640, 480, 319.5, 239.5, 34.0, 238.0, yaw=0.3),
        Fisheye(640, 480, 150.0, 319.5, 239.5, 238.0, 10.0, yaw=0.3),
    ],
)
def test_a_spot_appears_at_its_bearing_in_the_panorama(camera: Camera, bearing: float) -> None:
    # The bearing of a pixel is atan2(v - cy, u - cx) + yaw: the contract of the camera classes.
    u, v = 319.5 + 150 * math.cos(bearing - 0.3), 239.5 + 150 * math.sin(bearing - 0.3)
    found = brightest_azimuth(unwarped(camera, spot(640, 480, u, v)))
    assert abs(math.remainder(found - bearing, 2 * math.pi)) < math.radians(1.0)


@pytest.mark.parametrize("sense", ["clockwise", "counter_clockwise"])
def test_a_strip_is_rolled_and_mirrored_so_that_forward_is_in_the_middle_and_left_is_left(sense: str) -> None:
    # 30 columns past forward of 120 are a quarter turn: to the right where columns run clockwise.
    camera = Cylindrical(120, 25, 20.0, sense)  # type: ignore[arg-type]
    assert brightest_azimuth(unwarped(camera, spot(120, 25, 19.5, 12))) == pytest.approx(0.0, abs=0.03)
    turned = brightest_azimuth(unwarped(camera, spot(120, 25, 49.5, 12)))
    assert turned == pytest.approx(-math.pi / 2 if sense == "clockwise" else math.pi / 2, abs=0.03)


def test_a_strip_in_the_common_form_and_size_comes_back_unchanged() -> None:
    pixels = np.random.default_rng(0).integers(0, 256, (80, 360, 3), dtype=np.uint8)
    assert np.array_equal(unwarped(Cylindrical(360, 80, 180.0), pixels).pixels, pixels)


def test_an_equirectangular_picture_keeps_rows_at_their_elevations() -> None:
    pixels = np.zeros((180, 360, 3), np.uint8)
    pixels[90:] = 255  # below the horizon
    camera = Equirectangular(360, 180, 180.0, math.pi / 2, -math.pi / 2)
    panorama = unwarped(camera, pixels, rows=90)
    assert panorama.pixels[:44].max() == 0
    assert panorama.pixels[46:].min() == 255
    assert panorama.elevation_top == pytest.approx(math.pi / 2)


def test_the_mirror_s_elevations_are_those_of_its_mask() -> None:
    # The elevations that the recording's description gives for this mirror and mask: -60.8 to +30.0 degrees.
    top, bottom = elevation_range(MIRROR)
    assert math.degrees(top) == pytest.approx(30.0, abs=0.1)
    assert math.degrees(bottom) == pytest.approx(-60.8, abs=0.1)


@pytest.mark.parametrize("turn_columns", [1, 37, 200])
def test_a_mirror_image_turned_by_hand_is_the_panorama_rolled(turn_columns: int) -> None:
    # Turning the picture about its centre, clockwise on the screen, adds to every bearing: the scene moves left.
    random = np.random.default_rng(1).integers(0, 256, (480, 640, 3), dtype=np.uint8)
    smooth = cv2.GaussianBlur(random, (0, 0), 8)
    smooth = cv2.normalize(smooth, None, 0, 255, cv2.NORM_MINMAX)
    turn = cv2.getRotationMatrix2D((319.5, 239.5), -turn_columns, 1.0)  # positive is counter-clockwise on the screen
    turned = cv2.warpAffine(smooth, turn, (640, 480))
    before, after = unwarped(MIRROR, smooth).pixels, unwarped(MIRROR, turned).pixels
    gap = np.abs(np.roll(before, -turn_columns, axis=1).astype(int) - after)
    assert gap.mean() < 1.5


def ring_picture(centre: tuple[float, float], outer: float, inner: float, seed: int) -> Pixels:
    rng = np.random.default_rng(seed)
    v, u = np.mgrid[0:480, 0:640]
    radius = np.hypot(u - centre[0], v - centre[1])
    texture = cv2.GaussianBlur(rng.integers(60, 256, (480, 640, 3), dtype=np.uint8), (0, 0), 3)
    pixels = np.where(((radius < outer) & (radius > inner))[..., None], texture, 12)
    return pixels.astype(np.uint8)


@pytest.mark.parametrize("seed", range(3))
def test_the_ring_is_found_in_the_picture(seed: int) -> None:
    rng = np.random.default_rng(seed)
    centre = (320 + rng.uniform(-40, 40), 240 + rng.uniform(-15, 15))
    outer, inner = rng.uniform(190, 215), rng.uniform(35, 60)
    x, y, found_inner, found_outer = find_ring(ring_picture(centre, outer, inner, seed))
    assert math.hypot(x - centre[0], y - centre[1]) < 3.0
    assert abs(found_outer - outer) < 6.0
    assert abs(found_inner - inner) < 8.0


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
def test_the_ring_is_found_in_every_real_mirror_picture(name: str, ring: tuple[float, float, float, float]) -> None:
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


def test_a_picture_without_a_ring_says_so() -> None:
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


def test_what_was_found_once_stays_for_all_pictures() -> None:
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


def test_a_camera_that_does_not_see_the_circle_is_refused_in_one_line() -> None:
    with pytest.raises(BadInput, match="does not see the full circle") as refused:
        unwarped(Perspective(64, 48, 50.0, 50.0, 32.0, 24.0), np.zeros((48, 64, 3), np.uint8))
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(("stage", "camera"), [(HyperbolicUnwarp(), Donut(640, 480)), (StripUnwarp(), MIRROR)])
def test_a_stage_for_one_projection_names_the_option_for_all(stage: Stage, camera: Camera) -> None:
    ctx = Context("unwarp")
    stage.setup(ctx)
    with pytest.raises(BadInput, match="use unwarp=by_camera"):
        stage.step(ctx, Image(np.zeros((480, 640, 3), np.uint8)), camera)
