"""Cylindrical and equirectangular images: the full circle side by side."""

import math

import numpy as np
import pytest
from camera_round_trip import assert_mask, assert_round_trip
from hypothesis import given
from hypothesis import strategies as st

from omninav.stages.camera.cylindrical import Cylindrical
from omninav.stages.camera.equirectangular import Equirectangular
from omninav.stages.camera.rays import unit_vectors
from omninav.stages.camera.strip import Strip

UNKNOWN = Cylindrical(120, 25, 60.0)
STRIPS: list[Strip] = [
    Equirectangular(720, 150, 360.0, elevation_top=0.7, elevation_bottom=-0.6),
    Equirectangular(720, 150, 100.0, sense="counter_clockwise", elevation_top=0.7, elevation_bottom=-0.6, yaw=0.4),
    Cylindrical(720, 150, 360.0, elevation_top=0.5, elevation_bottom=-0.4),
    UNKNOWN,
]


@pytest.mark.parametrize("camera", STRIPS, ids=lambda camera: f"{camera.projection}, {camera.sense}")
@given(azimuth=st.floats(-math.pi, math.pi), elevation=st.floats(-1.5, 1.5))
def test_a_ray_comes_back_from_its_pixel(camera: Strip, azimuth: float, elevation: float) -> None:
    assert_round_trip(camera, azimuth, elevation)


@pytest.mark.parametrize("camera", STRIPS, ids=lambda camera: f"{camera.projection}, {camera.sense}")
def test_all_of_a_strip_shows_the_world(camera: Strip) -> None:
    assert_mask(camera)
    assert camera.mask().all()


def test_rows_are_elevations_in_one_and_their_tangents_in_the_other() -> None:
    middle = np.array([359.5, 74.5])
    degrees = [camera(720, 150, 360.0, elevation_top=1.2, elevation_bottom=-0.2).unproject(middle)[0][2]
               for camera in (Equirectangular, Cylindrical)]  # fmt: skip
    assert np.arcsin(degrees[0]) == pytest.approx(0.5)
    assert np.arcsin(degrees[1]) == pytest.approx(math.atan((math.tan(1.2) + math.tan(-0.2)) / 2))


@pytest.mark.parametrize(("sense", "left"), [("clockwise", 90.0), ("counter_clockwise", 270.0)])
def test_the_sense_says_on_which_side_left_is(sense: str, left: float) -> None:
    camera = Cylindrical(360, 20, 180.0, sense=sense)  # type: ignore[arg-type]
    assert camera.project(unit_vectors(math.pi / 2, 0.0))[0][0] == pytest.approx(left - 0.5)


def test_without_elevations_pixels_are_square_around_the_horizon() -> None:
    assert UNKNOWN.elevations == pytest.approx((25 * math.pi / 120, -25 * math.pi / 120))
    assert UNKNOWN.unproject(np.array([0.0, 12.0]))[0][2] == pytest.approx(0.0)
    assert not UNKNOWN.elevations_known
    assert Cylindrical(40, 100, 20.0).elevations == (math.pi / 2, -math.pi / 2)
