import math

import numpy as np
import pytest
from camera_round_trip import assert_mask, assert_round_trip
from hypothesis import given
from hypothesis import strategies as st

from omninav.stages.camera.fisheye import Fisheye
from omninav.stages.camera.rays import unit_vectors

CLOCKWISE = Fisheye(640, 480, 140.0, 318.0, 241.0, 230.0, yaw=-0.7)
COUNTER = Fisheye(640, 480, 140.0, 318.0, 241.0, 230.0, 5.0, "counter_clockwise", yaw=0.2)


@pytest.mark.parametrize("camera", [CLOCKWISE, COUNTER], ids=lambda camera: camera.sense)
@given(azimuth=st.floats(-math.pi, math.pi), elevation=st.floats(-1.5, 1.5))
def test_a_ray_comes_back_from_its_pixel(camera: Fisheye, azimuth: float, elevation: float) -> None:
    assert_round_trip(camera, azimuth, elevation)


def test_the_mask_is_the_disc_that_the_lens_lights() -> None:
    assert_mask(COUNTER)


def test_the_angle_from_the_zenith_grows_with_the_radius() -> None:
    horizon = 318.0 + 140.0 * math.pi / 2
    assert CLOCKWISE.unproject(np.array([horizon, 241.0]))[0] == pytest.approx(unit_vectors(-0.7, 0.0))
    assert CLOCKWISE.elevations == pytest.approx((math.pi / 2, math.pi / 2 - 230.0 / 140.0))
