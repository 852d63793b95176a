import math

import cv2
import numpy as np
import pytest

from omninav.pipeline import BadInput, Context
from omninav.stages.camera.cylindrical import Cylindrical
from omninav.stages.camera.donut import Donut
from omninav.stages.camera.equirectangular import Equirectangular
from omninav.stages.camera.fisheye import Fisheye
from omninav.stages.camera.hyperbolic import HyperbolicMirror
from omninav.stages.camera.model import Camera
from omninav.stages.camera.perspective import Perspective
from omninav.stages.unwarp.panorama import UnwarpPanorama
from omninav.stages.values.image import Image, Panorama, Pixels, column_azimuths

MIRROR = HyperbolicMirror(640, 480, 497.0, 497.0, 319.5, 239.5, 28.095, 23.4125, 34.0, 238.0, yaw=0.3)


def unwarped(camera: Camera, pixels: Pixels, columns: int = 360, rows: int = 80) -> Panorama:
    ctx, stage = Context("unwarp"), UnwarpPanorama(columns=columns, rows=rows)
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
    camera = Cylindrical(120, 25, 20.0, sense=sense)  # type: ignore[arg-type]
    assert brightest_azimuth(unwarped(camera, spot(120, 25, 19.5, 12))) == pytest.approx(0.0, abs=0.03)
    turned = brightest_azimuth(unwarped(camera, spot(120, 25, 49.5, 12)))
    assert turned == pytest.approx(-math.pi / 2 if sense == "clockwise" else math.pi / 2, abs=0.03)


def test_a_strip_in_the_common_form_and_size_comes_back_unchanged() -> None:
    pixels = np.random.default_rng(0).integers(0, 256, (80, 360, 3), dtype=np.uint8)
    assert np.array_equal(unwarped(Cylindrical(360, 80, 180.0), pixels).pixels, pixels)


def test_an_equirectangular_image_keeps_rows_at_their_elevations() -> None:
    pixels = np.zeros((180, 360, 3), np.uint8)
    pixels[90:] = 255  # below the horizon
    camera = Equirectangular(360, 180, 180.0, elevation_top=math.pi / 2, elevation_bottom=-math.pi / 2)
    panorama = unwarped(camera, pixels, rows=90)
    assert panorama.pixels[:44].max() == 0
    assert panorama.pixels[46:].min() == 255
    assert panorama.elevation_top == pytest.approx(math.pi / 2)


def test_a_cylinder_s_rows_are_brought_to_equal_steps_of_elevation() -> None:
    pixels = np.zeros((200, 360, 3), np.uint8)
    pixels[100:] = 255  # below a tangent of (tan 1.1 + tan -0.3) / 2
    camera = Cylindrical(360, 200, 180.0, elevation_top=1.1, elevation_bottom=-0.3)
    edge = math.atan((math.tan(1.1) + math.tan(-0.3)) / 2)
    row = (1.1 - edge) / 1.4 * 140
    panorama = unwarped(camera, pixels, rows=140)
    assert panorama.pixels[: round(row) - 1].max() == 0
    assert panorama.pixels[round(row) + 1 :].min() == 255
    assert (panorama.elevation_top, panorama.elevation_bottom) == (1.1, -0.3)


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


def test_a_camera_that_does_not_see_the_circle_is_refused_in_one_line() -> None:
    with pytest.raises(BadInput, match="does not see the full circle") as refused:
        unwarped(Perspective(64, 48, 50.0, 50.0, 32.0, 24.0), np.zeros((48, 64, 3), np.uint8))
    assert "\n" not in str(refused.value)
