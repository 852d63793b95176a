"""The double-sphere model against the models that it contains, and against the two spheres worked by hand."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omninav.stages.camera.double_sphere import DoubleSphere
from omninav.stages.camera.rays import unit_vectors
from omninav.stages.recordings.camera_yaml import write_camera

LENS = DoubleSphere(640, 480, 110.0, 108.0, 318.0, 241.0, -0.2, 0.59, outer_radius_px=230.0, yaw=0.4)
"""With numbers as calibrations of fisheye lenses of 190 degrees give them."""


@given(azimuth=st.floats(-math.pi, math.pi), elevation=st.floats(0.6, 1.5))
def test_without_both_spheres_it_is_a_pinhole(azimuth: float, elevation: float) -> None:
    pinhole = DoubleSphere(640, 480, 160.0, 160.0, 320.0, 240.0, 0.0, 0.0, outer_radius_px=235.0)
    radius = 160.0 / math.tan(elevation)
    expected = (320.0 + radius * math.cos(azimuth), 240.0 + radius * math.sin(azimuth))
    assert pinhole.project(unit_vectors(azimuth, elevation))[0] == pytest.approx(expected, rel=1e-9)


def test_a_point_is_projected_by_way_of_the_two_spheres() -> None:
    # The ray (3, 0, 4) / 5 on the first sphere; the second's centre is 0.2 below: (0.6, 0, 0.6) / sqrt(0.72) on it; the
    # pinhole is alpha / (1 - alpha) = 1 below that centre: x / z = 0.7071 / 1.7071, and K scales by 2 x 100 there.
    camera = DoubleSphere(640, 480, 100.0, 100.0, 320.0, 240.0, -0.2, 0.5, outer_radius_px=230.0)
    half = math.sqrt(0.5)
    expected = 320.0 + 200.0 * half / (1.0 + half)
    assert camera.project(np.array([3.0, 0.0, 4.0]))[0] == pytest.approx((expected, 240.0))


def test_it_sees_below_the_horizon_and_says_how_far() -> None:
    top, bottom = LENS.elevations or (0.0, 0.0)
    assert top == pytest.approx(math.pi / 2)
    assert -0.5 < bottom < 0.0
    assert not LENS.project(unit_vectors(0.3, -1.4))[1]


def test_camera_yaml_holds_its_two_numbers_beside_k() -> None:
    assert "double_sphere:\n  xi: -0.2\n  alpha: 0.59\n" in write_camera(LENS)
