"""Calibrated lenses against OpenCV, against numbers worked by hand, and at the limits of their models."""

from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from omninav.stages.camera.kannala_brandt import KannalaBrandt
from omninav.stages.camera.model import require_sight
from omninav.stages.camera.rays import unit_vectors
from omninav.stages.camera.unified import Unified
from omninav.stages.recordings.camera_yaml import camera_from_info, parse_camera, write_camera
from omninav.stages.recordings.recording import UnreadableRecording

BENT = (-0.012, 0.004, -0.003, 0.0006)


def test_a_fisheye_projects_as_opencv_does() -> None:
    camera = KannalaBrandt(1280, 960, 350.0, 348.0, 640.0, 480.0, BENT, skew=7.0)
    rays = unit_vectors(np.linspace(-3.0, 3.0, 500), np.linspace(0.05, 1.57, 500))
    k = np.array([[350.0, 0.0, 640.0], [0.0, 348.0, 480.0], [0.0, 0.0, 1.0]])
    expected, _ = cv2.fisheye.projectPoints(
        rays[:, None], np.zeros(3), np.zeros(3), k, np.array(BENT), alpha=7.0 / 350.0
    )
    np.testing.assert_allclose(camera.project(rays)[0], expected[:, 0], atol=1e-9)
    np.testing.assert_allclose(camera.unproject(expected[:, 0])[0], rays, atol=1e-9)
    assert parse_camera(write_camera(camera), "camera.yaml").skew == 7.0
    info = SimpleNamespace(width=1280, height=960, **camera.camera_info())
    assert camera_from_info(info, "log").skew == 7.0


def test_the_unified_model_worked_by_hand() -> None:
    # (2, -1, 2) / 3 from 0.5 behind the centre: (4, -2) / 7, and k1, k2, p1, p2 distort it.
    camera = Unified(640, 480, 200.0, 100.0, 320.0, 240.0, 0.5, (-0.1, 0.02, 0.001, 0.002), outer_radius_px=200.0)
    x, y = 4 / 7, -2 / 7
    square = x * x + y * y
    radial = 1.0 - 0.1 * square + 0.02 * square**2
    u = x * radial + 2.0 * 0.001 * x * y + 0.002 * (square + 2.0 * x * x)
    v = y * radial + 0.001 * (square + 2.0 * y * y) + 2.0 * 0.002 * x * y
    expected = (320.0 + 200.0 * u, 240.0 + 100.0 * v)
    assert camera.project(np.array([2.0, -1.0, 2.0]))[0] == pytest.approx(expected, abs=1e-9)
    assert camera.unproject(np.array(expected))[0] == pytest.approx(np.array([2.0, -1.0, 2.0]) / 3)


def test_a_mirror_above_the_camera_shows_the_floor_in_the_middle_and_bearings_as_a_lens_does() -> None:
    lens, mirror = (
        Unified(640, 480, 290.0, 290.0, 320.0, 240.0, 0.9, (-0.1, 0.0, 0.0, 0.0), looks=looks, yaw=0.3)
        for looks in ("up", "down")
    )
    pixels = np.array([[420.0, 300.0], [250.0, 130.0]])
    up, down = (camera.unproject(pixels)[0] for camera in (lens, mirror))
    np.testing.assert_allclose(up * [1, 1, -1], down, atol=1e-12)
    assert (down[:, 2] < 0.0).all()


@pytest.mark.parametrize(
    "camera",
    [
        KannalaBrandt(640, 480, 150.0, 150.0, 320.0, 240.0, (-0.2, 0.0, 0.0, 0.0)),  # grows up to 1.29 rad alone
        Unified(640, 480, 300.0, 300.0, 320.0, 240.0, 0.8, (-0.5, 0.0, 0.0, 0.0)),
    ],
    ids=lambda camera: camera.projection,
)
def test_what_lies_beyond_the_model_is_not_shown_and_the_mask_ends_there(camera) -> None:
    top, bottom = camera.elevations
    assert top == pytest.approx(np.pi / 2)
    assert 0.1 < bottom < 0.9
    require_sight(camera)
    assert not camera.project(unit_vectors(0.3, bottom - 0.1))[1]
    assert "outer_radius_px" in write_camera(camera)  # what was found stands in the file
    assert not camera.unproject(np.array([camera.centre_x + camera.outer_radius_px + 15.0, camera.centre_y]))[1]


def test_the_default_mask_ends_where_the_model_does_in_any_direction() -> None:
    camera = KannalaBrandt(900, 900, 200.0, 170.0, 449.5, 449.5, (-0.08, 0.0, 0.0, 0.0))  # grows up to 2.04 rad alone
    around = np.linspace(-np.pi, np.pi, 360)[:, None]
    rim = 449.5 + camera.outer_radius_px * np.concatenate([np.cos(around), np.sin(around)], axis=1)
    assert camera.unproject(rim)[1].all()
    beyond = np.array([449.5, 449.5 + camera.outer_radius_px + 1.0])
    assert not camera.unproject(beyond)[1]


def test_a_ray_beyond_a_fold_of_tangential_distortion_is_not_shown() -> None:
    camera = Unified(640, 480, 300.0, 300.0, 320.0, 240.0, 0.8, (0.0, 0.0, 0.0, 0.1), outer_radius_px=235.0)
    azimuths, elevations = np.meshgrid(np.linspace(-np.pi, np.pi, 90), np.linspace(-1.0, 1.57, 120))
    rays = unit_vectors(azimuths.ravel(), elevations.ravel())
    pixels, shown = camera.project(rays)
    back, known = camera.unproject(pixels[shown])
    assert 0.2 < shown.mean() < 0.9
    assert known.all()
    np.testing.assert_allclose(back, rays[shown], atol=1e-6)


def test_a_wrong_number_of_coefficients_is_refused() -> None:
    for camera in (KannalaBrandt(640, 480, 150.0, 150.0, 320.0, 240.0, BENT),
                   Unified(640, 480, 300.0, 300.0, 320.0, 240.0, 0.8, BENT)):  # fmt: skip
        text = write_camera(camera)
        assert write_camera(parse_camera(text, "camera.yaml")) == text
        with pytest.raises(Exception, match="'D' has 3 numbers, expected 4"):
            parse_camera(text.replace("- 0.0006\n", ""), "camera.yaml")


def test_numbers_that_no_lens_has_are_no_reason_to_fail() -> None:
    k = [150.0, 0.0, 320.0, 0.0, 150.0, 240.0, 0.0, 0.0, 1.0]
    assert KannalaBrandt.from_camera_info("equidistant", (640, 480), k, [1e308] * 4) is None
    assert KannalaBrandt.from_camera_info("plumb_bob", (640, 480), k, [0.0] * 4) is None
    tiny = KannalaBrandt.from_camera_info("equidistant", (640, 480), k, [0.0, 0.0, 0.0, 1e-320])
    assert tiny.elevations == pytest.approx((np.pi / 2, np.pi / 2 - 239.0 / 150.0))
    far = [150.0, 0.0, 2e9, 0.0, 150.0, 2e9, 0.0, 0.0, 1.0]
    huge = {"width": 4 * 10**9, "height": 4 * 10**9, "k": far, "d": [0.0] * 4, "distortion_model": "equidistant"}
    with pytest.raises(UnreadableRecording, match="pixels"):
        camera_from_info(SimpleNamespace(**huge), "log")
