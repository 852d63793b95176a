"""A panorama read by its own camera."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omninav.stages.camera.equirectangular import camera_behind, panorama_camera
from omninav.stages.camera.model import seen_at
from omninav.stages.camera.perspective import Perspective
from omninav.stages.camera.rays import unit_vectors
from omninav.stages.values.image import Image, Panorama, column_azimuths


def panorama(rows: int, columns: int, top: float | None, bottom: float | None) -> Panorama:
    return Panorama(np.zeros((rows, columns, 3), np.uint8), top, bottom)


@given(azimuth=st.floats(-3.1, 3.1), elevation=st.floats(-0.39, 0.49), known=st.booleans())
def test_a_point_of_a_panorama_comes_back_from_its_ray(azimuth: float, elevation: float, known: bool) -> None:
    camera = panorama_camera(panorama(90, 360, *((0.5, -0.4) if known else (None, None))))
    ray = unit_vectors(azimuth, elevation)
    assert camera.unproject(seen_at(camera, ray))[0] == pytest.approx(ray, abs=1e-9)
    assert np.isnan(seen_at(camera, unit_vectors(azimuth, 1.2))[1])


def test_columns_of_a_panorama_look_where_the_common_form_says() -> None:
    camera = panorama_camera(panorama(20, 36, 0.5, -0.5))
    rays = camera.unproject(np.stack([np.arange(36.0), np.full(36, 9.5)], axis=-1))[0]
    assert np.arctan2(rays[:, 1], rays[:, 0]) == pytest.approx(column_azimuths(36))
    assert rays[:, 2] == pytest.approx(np.zeros(36), abs=1e-12)  # rows 9 and 10 are around the middle
    edges = camera.unproject(np.array([[0.0, -0.5], [0.0, 19.5]]))[0]
    assert np.arcsin(edges[:, 2]) == pytest.approx([0.5, -0.5])


def test_without_elevations_pixels_are_square_around_the_horizon() -> None:
    top = panorama_camera(panorama(25, 120, None, None)).unproject(np.array([0.0, -0.5]))[0]
    assert math.asin(top[2]) == pytest.approx(12.5 * 2.0 * math.pi / 120)


def test_a_panorama_needs_no_camera_and_an_image_has_the_one_that_is_given() -> None:
    given_camera = Perspective(64, 48, 50.0, 50.0, 32.0, 24.0)
    assert camera_behind(Image(np.zeros((48, 64, 3), np.uint8)), given_camera) is given_camera
    assert camera_behind(Image(np.zeros((48, 64, 3), np.uint8)), None) is None
    assert camera_behind(panorama(20, 36, None, None), None) is not None
