import math

import numpy as np
import pytest
from camera_round_trip import assert_mask, assert_round_trip
from hypothesis import given
from hypothesis import strategies as st

from omninav.stages.camera.perspective import Perspective
from omninav.stages.camera.rays import unit_vectors

CAMERA = Perspective(640, 480, 500.0, 480.0, 320.0, 240.0, 0.3, yaw=0.5)


@given(azimuth=st.floats(-math.pi, math.pi), elevation=st.floats(-1.5, 1.5))
def test_a_ray_comes_back_from_its_pixel(azimuth: float, elevation: float) -> None:
    assert_round_trip(CAMERA, azimuth, elevation)


def test_all_of_the_image_shows_the_world() -> None:
    assert_mask(CAMERA)
    assert CAMERA.mask().all()


def test_it_looks_along_its_axis() -> None:
    camera = Perspective(640, 480, 500.0, 500.0, 320.0, 240.0, yaw=0.5)
    ahead, left = camera.unproject(np.array([[320.0, 240.0], [-180.0, 240.0]]))[0]
    assert ahead == pytest.approx(unit_vectors(0.5, 0.0))
    assert left == pytest.approx(unit_vectors(0.5 + math.pi / 4, 0.0))
    assert camera.elevations is None


def test_what_lies_behind_is_not_shown() -> None:
    assert not CAMERA.project(unit_vectors(0.5 + math.pi, 0.0))[1]
