"""Pixels as directions, over all cameras."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omninav.pipeline.graph.problems import BadInput
from omninav.stages.camera.bearings import camera_bearings, panorama_bearings, unit_vectors
from omninav.stages.camera.models import Camera, Cylindrical, Donut, Equirectangular, Fisheye, HyperbolicMirror
from omninav.stages.camera.models import Perspective as Pinhole
from omninav.stages.camera.rays import panorama_points, pixels_of_rays
from omninav.stages.values.image import column_azimuths

MIRROR = HyperbolicMirror(640, 480, 497.0, 490.0, 319.5, 239.5, 28.095, 23.4125, 34.0, 238.0, 0.4, 0.9, 0.3)
CAMERAS: list[Camera] = [
    MIRROR,
    Fisheye(640, 480, 140.0, 318.0, 241.0, 230.0, 0.0, "clockwise", None, -0.7),
    Fisheye(640, 480, 140.0, 318.0, 241.0, 230.0, 0.0, "counter_clockwise", None, 0.2),
    Equirectangular(720, 150, 360.0, 0.7, -0.6),
    Equirectangular(720, 150, 100.0, 0.7, -0.6, "counter_clockwise"),
    Cylindrical(720, 150, 360.0, "clockwise", None, 0.5, -0.4),
]


@pytest.mark.parametrize("camera", CAMERAS, ids=lambda camera: type(camera).__name__)
@given(azimuth=st.floats(-math.pi, math.pi), elevation=st.floats(-1.0, 0.6))
def test_a_bearing_is_the_ray_whose_pixel_it_was_taken_from(camera: Camera, azimuth: float, elevation: float) -> None:
    ray = unit_vectors(azimuth, elevation)
    u, v = pixels_of_rays(camera, ray)
    strip = isinstance(camera, Cylindrical | Equirectangular)
    if np.isnan(u) or np.isnan(v) or (strip and not 0.01 < float(v) < camera.height_px - 1.01):
        return  # out of sight, or clamped to a strip's edge
    assert camera_bearings(np.array([u, v]), camera) == pytest.approx(ray, abs=1e-7)


@given(azimuth=st.floats(-3.1, 3.1), elevation=st.floats(-0.39, 0.49), known=st.booleans())
def test_a_point_of_a_panorama_comes_back_from_its_bearing(azimuth: float, elevation: float, known: bool) -> None:
    span = (0.5, -0.4) if known else (None, None)
    ray = unit_vectors(azimuth, elevation)
    point = panorama_points(ray, (90, 360), *span)
    assert panorama_bearings(point, (90, 360), *span) == pytest.approx(ray, abs=1e-9)
    assert np.isnan(panorama_points(unit_vectors(azimuth, 1.2), (90, 360), *span)[1])


def test_columns_of_a_panorama_look_where_the_common_form_says() -> None:
    points = np.stack([np.arange(36.0), np.full(36, 9.5)], axis=-1)
    bearings = panorama_bearings(points, (20, 36, 3), 0.5, -0.5)
    assert np.arctan2(bearings[:, 1], bearings[:, 0]) == pytest.approx(column_azimuths(36))
    assert bearings[:, 2] == pytest.approx(np.zeros(36), abs=1e-12)  # rows 9 and 10 are around the middle
    edges = panorama_bearings(np.array([[0.0, -0.5], [0.0, 19.5]]), (20, 36), 0.5, -0.5)
    assert np.arcsin(edges[:, 2]) == pytest.approx([0.5, -0.5])


def test_without_elevations_pixels_are_square_around_the_horizon() -> None:
    top = panorama_bearings(np.array([[0.0, -0.5]]), (25, 120), None, None)
    assert math.asin(top[0, 2]) == pytest.approx(12.5 * 2.0 * math.pi / 120)
    strip = Cylindrical(120, 25, 60.0)
    assert camera_bearings(np.array([[0.0, -0.5]]), strip) == pytest.approx(top)


def test_an_ordinary_camera_looks_along_its_axis() -> None:
    camera = Pinhole(640, 480, 500.0, 500.0, 320.0, 240.0, 0.0, None, 0.5)
    ahead, left = camera_bearings(np.array([[320.0, 240.0], [-180.0, 240.0]]), camera)
    assert ahead == pytest.approx(unit_vectors(0.5, 0.0))
    assert left == pytest.approx(unit_vectors(0.5 + math.pi / 4, 0.0))


def test_a_pixel_that_the_mirror_does_not_show_has_no_bearing() -> None:
    assert np.isnan(camera_bearings(np.array([[5000.0, 240.0]]), MIRROR)).all()


def test_a_donut_needs_its_ring() -> None:
    with pytest.raises(BadInput, match=r"give its model in camera\.yaml"):
        camera_bearings(np.zeros((1, 2)), Donut(640, 480))
    ring = Donut(640, 480, 320.0, 240.0, 40.0, 200.0, "counter_clockwise", 0.1)
    assert camera_bearings(np.array([[320.0, 120.0]]), ring)[0] == pytest.approx(unit_vectors(math.pi / 2 + 0.1, 0.0))
