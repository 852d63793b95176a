"""The closed forms of the hyperbolic mirror against the surface they stand for."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omninav.pipeline import BadInput
from omninav.stages.camera.hyperbolic import HyperbolicMirror

HOUSE = HyperbolicMirror(
    640, 480, 497.0, 490.0, 319.5, 239.5, 28.095, 23.4125, 34.0, 238.0, skew=0.4, height=0.9, yaw=0.3
)
MIRRORS = st.tuples(st.floats(5.0, 60.0), st.floats(5.0, 60.0))
INTRINSICS = st.tuples(
    st.floats(100.0, 900.0), st.floats(100.0, 900.0), st.floats(0.0, 800.0), st.floats(0.0, 800.0), st.floats(-2.0, 2.0)
)
DIRECTIONS = st.tuples(st.floats(-1.0, 1.0), st.floats(-math.pi, math.pi))  # sine of elevation, bearing


def unit(sine: float, bearing: float) -> np.ndarray:
    cosine = math.sqrt(1.0 - sine * sine)
    return np.array([cosine * math.cos(bearing), cosine * math.sin(bearing), sine])


def mirror(intrinsics: tuple[float, ...], a: float, b: float) -> HyperbolicMirror:
    """One whose image and ring hold whatever it shows."""
    fx, fy, cx, cy, skew = intrinsics
    return HyperbolicMirror(800, 800, fx, fy, cx, cy, a, b, 0.0, 1e9, skew=skew)


def test_the_mask_is_the_ring_of_pixels_that_look_somewhere() -> None:
    v, u = np.mgrid[0:480, 0:640]
    radius = np.hypot(u - 319.5, v - 239.5)
    assert np.array_equal(HOUSE.mask(), (radius >= 34.0) & (radius <= 238.0))


@given(MIRRORS, INTRINSICS, DIRECTIONS)
def test_a_ray_of_any_mirror_comes_back_from_its_pixel_or_has_none(
    axes: tuple[float, float], intrinsics: tuple[float, ...], direction: tuple[float, float]
) -> None:
    ray, (a, b) = unit(*direction), axes
    camera = mirror(intrinsics, a, b)
    pixel, _ = camera.project(ray)
    margin = a - math.hypot(a, b) * ray[2]
    if margin <= 0:
        assert np.isnan(pixel).all()
    elif margin > 1e-3 * a:
        np.testing.assert_allclose(camera.unproject(pixel)[0], ray, atol=1e-7)


@given(MIRRORS, DIRECTIONS)
def test_the_line_of_sight_through_a_pixel_meets_the_ray_on_the_upper_sheet_of_the_mirror(
    axes: tuple[float, float], direction: tuple[float, float]
) -> None:
    a, b = axes
    e = math.hypot(a, b)
    ray = unit(*direction)
    level = math.hypot(ray[0], ray[1])
    if a - e * ray[2] <= 1e-2 * a or level < 1e-3:
        return
    u, v = mirror((500.0, 500.0, 320.0, 320.0, 0.0), a, b).project(ray)[0]
    q = math.hypot(u - 320.0, v - 320.0) / 500.0
    along = 2 * e * q / (level - q * ray[2])  # where the lines s * ray and t * (q, 1) - (0, 0, 2e) cross
    assert along > 0
    assert along * ray[2] + e > 0
    x, z = along * level, along * ray[2] + e
    assert abs(z**2 / a**2 - x**2 / b**2 - 1.0) < 1e-6 * (1.0 + z**2 / a**2)


def test_pixels_past_the_asymptote_look_nowhere() -> None:
    a, b = 28.095, 23.4125
    limit = math.sqrt((a * a + b * b) / (a * a) - 1.0) * 497.0  # |q| = e / a
    inside, outside = (320.0 + 0.999 * limit, 240.0), (320.0 + 1.001 * limit, 240.0)
    rays, looks = mirror((497.0, 497.0, 320.0, 240.0, 0.0), a, b).unproject(np.array([inside, outside]))
    assert looks.tolist() == [True, False]
    assert np.isfinite(rays[0]).all()
    assert np.isnan(rays[1]).all()


def test_the_ring_of_a_known_camera_spans_the_elevations_its_maker_states() -> None:
    """photoreal-house: radii 34 and 238 px are elevations -60.8 and +30.0 degrees."""
    house = HyperbolicMirror(640, 480, 497.0, 497.0, 319.5, 239.5, 28.095, 23.4125, 34.0, 238.0)
    np.testing.assert_allclose(np.degrees(house.elevations), [30.0, -60.8], atol=0.05)


def test_a_ring_beyond_the_mirror_is_refused() -> None:
    beyond = HyperbolicMirror(640, 480, 497.0, 497.0, 319.5, 239.5, 28.095, 23.4125, 34.0, 900.0)
    with pytest.raises(BadInput, match=r"the mask \(34 to 900 px\) reaches beyond what this hyperbolic camera shows"):
        _ = beyond.elevations
