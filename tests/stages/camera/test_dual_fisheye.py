import math

import numpy as np
import pytest
from camera_round_trip import assert_mask, assert_round_trip
from hypothesis import given
from hypothesis import strategies as st

from omninav.stages.camera.dual_fisheye import DualFisheye
from omninav.stages.camera.rays import unit_vectors
from omninav.stages.recordings.camera_yaml import parse_camera, write_camera

UPRIGHT = DualFisheye.of_size(640, 320)
TURNED = DualFisheye(640, 320, 96.0, 158.0, 161.0, 482.0, 159.0, 156.0, 0.4, -2.0, yaw=0.7)


@pytest.mark.parametrize("camera", [UPRIGHT, TURNED], ids=["upright", "turned"])
@given(azimuth=st.floats(-math.pi, math.pi), elevation=st.floats(-1.5, 1.5))
def test_a_ray_comes_back_from_its_pixel(camera: DualFisheye, azimuth: float, elevation: float) -> None:
    assert_round_trip(camera, azimuth, elevation)


@pytest.mark.parametrize("camera", [UPRIGHT, TURNED], ids=["upright", "turned"])
def test_the_mask_is_a_half_sphere_of_each_circle(camera: DualFisheye) -> None:
    assert_mask(camera)


def test_each_lens_is_upright_and_shows_what_is_right_of_its_axis_on_the_right() -> None:
    def at(azimuth: float, elevation: float) -> np.ndarray:
        return UPRIGHT.project(unit_vectors(azimuth, elevation))[0]

    radian = 160.0 / math.radians(95.0)
    assert at(0.0, 0.0) == pytest.approx([159.5, 159.5])
    assert at(-0.5, 0.0) == pytest.approx([159.5 + 0.5 * radian, 159.5])  # right of forward
    assert at(0.0, 0.5) == pytest.approx([159.5, 159.5 - 0.5 * radian])  # above it
    assert at(math.pi, 0.0) == pytest.approx([479.5, 159.5])
    assert at(math.pi - 0.5, 0.0) == pytest.approx([479.5 + 0.5 * radian, 159.5])  # left of the robot


def test_it_is_written_and_read_as_camera_yaml() -> None:
    assert write_camera(parse_camera(write_camera(TURNED), "camera.yaml")) == write_camera(TURNED)
