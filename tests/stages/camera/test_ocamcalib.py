"""The polynomial model against cameras whose polynomial is known in closed form."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omninav.stages.camera.ocamcalib import OCamCalib
from omninav.stages.camera.rays import unit_vectors
from omninav.stages.recordings.camera_yaml import parse_camera, write_camera
from omninav.stages.recordings.recording import UnreadableRecording

LENS = OCamCalib(640, 480, (-170.0, 0.0, 1.4e-3, -2.0e-6, 9.0e-9), 241.0, 318.0, 230.0, 5.0, 0.9991, -3e-4, 2e-4)
MIRROR = OCamCalib(640, 480, (-140.0, 0.0, 4.0e-3), 239.5, 319.5, 236.0, 34.0, looks="down", yaw=0.3)


@given(azimuth=st.floats(-math.pi, math.pi), elevation=st.floats(-1.2, 0.6))
def test_a_parabolic_mirror_has_a_polynomial_of_two_terms(azimuth: float, elevation: float) -> None:
    # Geyer & Daniilidis: seen from its focus, a parabola z = rho^2 / (2 p) - p / 2 and parallel lines of sight.
    p = 120.0
    parabola = OCamCalib(640, 640, (-p / 2, 0.0, 1 / (2 * p)), 320.0, 320.0, 310.0, looks="down")
    radius = p * (1.0 + math.sin(elevation)) / math.cos(elevation)
    pixel, shown = parabola.project(unit_vectors(azimuth, elevation))
    expected = (320.0 + radius * math.cos(azimuth), 320.0 + radius * math.sin(azimuth))
    assert pixel == pytest.approx(expected, abs=1e-6)
    assert bool(shown) == (radius <= 310.0)


def test_a_lens_looks_up_in_the_middle_and_a_mirror_down() -> None:
    middle = np.array([318.0, 241.0])
    assert LENS.unproject(middle)[0] == pytest.approx((0.0, 0.0, 1.0))
    assert LENS.project(np.array([0.0, 0.0, 1.0]))[0] == pytest.approx(middle)
    assert (LENS.elevations or (0.0,))[0] == pytest.approx(math.pi / 2, abs=0.05)
    assert MIRROR.unproject(np.array([319.5, 239.5]))[0] == pytest.approx((0.0, 0.0, -1.0))


def test_affine_parameters_move_rows_by_columns_and_columns_by_rows() -> None:
    skewed = OCamCalib(640, 480, (-170.0, 0.0, 1e-3), 240.0, 320.0, 230.0, 0.0, 1.1, 0.2, 0.1)
    plain = OCamCalib(640, 480, (-170.0, 0.0, 1e-3), 240.0, 320.0, 230.0)
    ray = unit_vectors(0.7, 0.8)
    column, row = plain.project(ray)[0] - (320.0, 240.0)
    assert skewed.project(ray)[0] == pytest.approx((320.0 + 0.1 * row + column, 240.0 + 1.1 * row + 0.2 * column))


def test_a_polynomial_that_bends_the_other_way_or_is_no_list_of_numbers_is_refused() -> None:
    with pytest.raises(UnreadableRecording, match=r"'ocamcalib\.polynomial' must be \[a0, a1, …\] with a0 below 0"):
        parse_camera(write_camera(LENS).replace("- -170.0", "- 170.0"), "camera.yaml")
    with pytest.raises(UnreadableRecording, match=r"'ocamcalib\.polynomial' must hold numbers, not a list"):
        parse_camera(write_camera(LENS).replace("- -170.0", "- [1, 2]"), "camera.yaml")
    with pytest.raises(ValueError, match=r"'ocamcalib\.c' must be above d \* e"):
        OCamCalib(640, 480, (-170.0, 0.0), 240.0, 320.0, 230.0, 0.0, 0.25, 0.5, 0.5)
