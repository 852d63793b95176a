"""Each camera model keeps its promises; pixels look where one works it out by hand."""

import math

import numpy as np
import pytest
from camera_round_trip import assert_mask, assert_round_trip
from hypothesis import given
from hypothesis import strategies as st

from omninav.stages.camera.cylindrical import Cylindrical
from omninav.stages.camera.donut import Donut
from omninav.stages.camera.double_sphere import DoubleSphere
from omninav.stages.camera.dual_fisheye import DualFisheye
from omninav.stages.camera.equirectangular import Equirectangular
from omninav.stages.camera.fisheye import Fisheye
from omninav.stages.camera.hyperbolic import HyperbolicMirror
from omninav.stages.camera.kannala_brandt import KannalaBrandt
from omninav.stages.camera.model import Camera
from omninav.stages.camera.ocamcalib import OCamCalib
from omninav.stages.camera.perspective import Perspective
from omninav.stages.camera.rays import unit_vectors
from omninav.stages.camera.unified import Unified
from omninav.stages.recordings.camera_yaml import parse_camera, write_camera

CAMERAS: list[Camera] = [
    Cylindrical(720, 150, 360.0, elevation_top=0.5, elevation_bottom=-0.4),
    Cylindrical(120, 25, 60.0),
    Donut(640, 480, 320.0, 240.0, 40.0, 200.0, "counter_clockwise", yaw=0.1),
    DoubleSphere(640, 480, 110.0, 108.0, 318.0, 241.0, -0.2, 0.59, outer_radius_px=230.0, yaw=0.4),
    DualFisheye.of_size(640, 320),
    DualFisheye(640, 320, 96.0, 158.0, 161.0, 482.0, 159.0, 156.0, 0.4, -2.0, yaw=0.7),
    Equirectangular(720, 150, 360.0, elevation_top=0.7, elevation_bottom=-0.6),
    Equirectangular(720, 150, 100.0, sense="counter_clockwise", elevation_top=0.7, elevation_bottom=-0.6, yaw=0.4),
    Fisheye(640, 480, 140.0, 318.0, 241.0, 230.0, yaw=-0.7),
    Fisheye(640, 480, 140.0, 318.0, 241.0, 230.0, 5.0, "counter_clockwise", yaw=0.2),
    HyperbolicMirror(640, 480, 497.0, 490.0, 319.5, 239.5, 28.095, 23.4125, 34.0, 238.0, skew=0.4, height=0.9, yaw=0.3),
    KannalaBrandt(640, 480, 140.0, 138.0, 318.0, 241.0, (-0.012, 0.004, -0.003, 0.0006), yaw=0.4),
    KannalaBrandt(640, 480, 210.0, 208.0, 318.0, 241.0, (0.02, -0.03, 0.001, 0.0), yaw=-0.2),
    OCamCalib(640, 480, (-170.0, 0.0, 1.4e-3, -2.0e-6, 9.0e-9), 241.0, 318.0, 230.0, 5.0, 0.9991, -3e-4, 2e-4),
    OCamCalib(640, 480, (-140.0, 0.0, 4.0e-3), 239.5, 319.5, 236.0, 34.0, looks="down", yaw=0.3),
    Perspective(640, 480, 500.0, 480.0, 320.0, 240.0, skew=0.3, yaw=0.5),
    Unified(640, 480, 290.0, 288.0, 318.0, 241.0, 0.9, (-0.25, 0.05, 1e-3, -6e-4), yaw=0.1),
    Unified(640, 480, 480.0, 478.0, 318.0, 241.0, 2.2134, (0.0168, 1.65, 4e-4, 4e-4), looks="down"),
]
SPHERES: list[Camera] = [
    DoubleSphere(640, 480, 160.0, 158.0, 318.0, 241.0, xi, alpha, outer_radius_px=230.0)
    for xi in (-0.3, 0.0, 0.4)
    for alpha in (0.0, 0.3, 0.5, 0.62)
]
each_camera = pytest.mark.parametrize("camera", CAMERAS, ids=lambda camera: camera.projection)


@each_camera
def test_only_what_looks_down_into_a_mirror_or_counts_the_other_way_shows_the_world_mirrored(camera: Camera) -> None:
    fields = vars(camera)
    reflected = isinstance(camera, HyperbolicMirror | Donut) or fields.get("looks") == "down"
    assert camera.mirrored == (reflected != (fields.get("sense") == "counter_clockwise"))


@pytest.mark.parametrize("camera", CAMERAS + SPHERES, ids=lambda camera: camera.projection)
@given(azimuth=st.floats(-math.pi, math.pi), elevation=st.floats(-1.55, 1.55))
def test_a_ray_comes_back_from_its_pixel(camera: Camera, azimuth: float, elevation: float) -> None:
    assert_round_trip(camera, azimuth, elevation)


@each_camera
def test_the_mask_is_what_shows_the_world(camera: Camera) -> None:
    """All of a strip or of an ordinary picture; of any other one its ring, its disc or its circles."""
    assert_mask(camera)
    whole = isinstance(camera, (Cylindrical, Equirectangular, Perspective))
    assert camera.mask().all() == whole


@each_camera
def test_it_is_written_and_read_as_camera_yaml(camera: Camera) -> None:
    assert write_camera(parse_camera(write_camera(camera), "camera.yaml")) == write_camera(camera)


QUARTER = math.pi / 2
FISHEYE = Fisheye(640, 480, 140.0, 318.0, 241.0, 230.0, yaw=-0.7)
ORDINARY = Perspective(640, 480, 500.0, 500.0, 320.0, 240.0, yaw=0.5)
PAIR, PAIR_PX = DualFisheye.of_size(640, 320), 160.0 / math.radians(95.0)
UNKNOWN = Cylindrical(120, 25, 60.0)
STRIP = Equirectangular(720, 150, 360.0, elevation_top=1.2, elevation_bottom=-0.2)
CYLINDER = Cylindrical(720, 150, 360.0, elevation_top=1.2, elevation_bottom=-0.2)


@pytest.mark.parametrize(
    ("camera", "pixel", "azimuth", "elevation"),
    [
        (FISHEYE, (318.0 + 140.0 * QUARTER, 241.0), -0.7, 0.0),  # the angle from the zenith grows with the radius
        (ORDINARY, (320.0, 240.0), 0.5, 0.0),
        (ORDINARY, (-180.0, 240.0), 0.5 + math.pi / 4, 0.0),
        (ORDINARY, (320.0, -260.0), 0.5, math.pi / 4),
        (PAIR, (159.5, 159.5), 0.0, 0.0),
        (PAIR, (159.5 + 0.5 * PAIR_PX, 159.5), -0.5, 0.0),  # right of forward
        (PAIR, (159.5, 159.5 - 0.5 * PAIR_PX), 0.0, 0.5),
        (PAIR, (479.5, 159.5), math.pi, 0.0),
        (PAIR, (479.5 + 0.5 * PAIR_PX, 159.5), math.pi - 0.5, 0.0),  # left of the robot
        (Donut(640, 480, 320.0, 240.0, 40.0, 200.0, "counter_clockwise", yaw=0.1), (320.0, 120.0), QUARTER + 0.1, 0.0),
        (Donut(640, 480, 320.0, 240.0, 50.0, 190.0), (392.0, 336.0), math.atan2(96.0, 72.0), 0.0),
        (STRIP, (359.5, 74.5), 0.0, 0.5),  # rows are elevations
        (CYLINDER, (359.5, 74.5), 0.0, math.atan((math.tan(1.2) + math.tan(-0.2)) / 2)),  # their tangents
        (Cylindrical(360, 20, 180.0), (89.5, 9.5), QUARTER, 0.0),
        (Cylindrical(360, 20, 180.0, sense="counter_clockwise"), (269.5, 9.5), QUARTER, 0.0),
        (UNKNOWN, (59.5, 12.0), 0.0, 0.0),
    ],
)
def test_a_pixel_looks_where_the_model_says(
    camera: Camera, pixel: tuple[float, float], azimuth: float, elevation: float
) -> None:
    ray = unit_vectors(azimuth, elevation)
    assert camera.unproject(np.array(pixel))[0] == pytest.approx(ray)
    assert camera.project(ray)[0] == pytest.approx(pixel)


def test_elevations_are_those_of_the_edges_of_what_is_seen() -> None:
    assert FISHEYE.elevations == pytest.approx((QUARTER, QUARTER - 230.0 / 140.0))
    assert PAIR.elevations == (QUARTER, -QUARTER)
    assert ORDINARY.elevations is None
    assert not ORDINARY.project(unit_vectors(0.5 + math.pi, 0.0))[1]  # what lies behind
    assert UNKNOWN.elevations == pytest.approx((25 * math.pi / 120, -25 * math.pi / 120))  # of square pixels
    assert not UNKNOWN.elevations_known
    assert Cylindrical(40, 100, 20.0).elevations == (QUARTER, -QUARTER)
    half_known = Cylindrical(120, 25, 60.0, elevation_top=1.0), Cylindrical(120, 25, 60.0, elevation_bottom=-1.0)
    assert [camera.elevations == UNKNOWN.elevations for camera in half_known] == [True, True]
    assert [camera.elevations_known for camera in (*half_known, CYLINDER)] == [False, False, True]


def test_a_camera_info_gives_the_camera_back_and_another_model_none() -> None:
    skewed = Perspective(640, 480, 500.0, 480.0, 320.0, 240.0, skew=0.3)
    mirror = HyperbolicMirror(640, 480, 497.0, 490.0, 330.5, 230.5, 28.0, 23.0, 0.0, 230.5, skew=0.4)
    k = mirror.camera_info()["k"]
    assert k == [497.0, 0.4, 330.5, 0.0, 490.0, 230.5, 0.0, 0.0, 1.0]
    for model, d in (("plumb_bob", [0.0] * 5), ("", [])):
        back = Perspective.from_camera_info(model, (640, 480), skewed.camera_info()["k"], d)
        assert vars(back) == vars(skewed)
    assert vars(HyperbolicMirror.from_camera_info("hyperbolic_mirror", (640, 480), k, [28.0, 23.0])) == vars(mirror)
    for width, height in ((500, 480), (640, 400)):  # what is right of or below the centre is nearer
        cut = HyperbolicMirror.from_camera_info("hyperbolic_mirror", (width, height), k, [28.0, 23.0])
        assert cut.outer_radius_px == min(width - 331.5, height - 231.5)
    assert Perspective.from_camera_info("plumb_bob", (640, 480), k, [0.0, 0.1]) is None
    assert Perspective.from_camera_info("equidistant", (640, 480), k, []) is None
    assert HyperbolicMirror.from_camera_info("plumb_bob", (640, 480), k, [28.0, 23.0]) is None
    assert HyperbolicMirror.from_camera_info("hyperbolic_mirror", (640, 480), k, [28.0]) is None


def test_a_picture_twice_as_wide_as_high_is_the_whole_sphere() -> None:
    whole = Equirectangular(720, 360, 360.0, elevation_top=QUARTER, elevation_bottom=-QUARTER)
    assert vars(Equirectangular.of_size(720, 360)) == vars(whole)
    assert vars(Equirectangular.of_size(720, 150)) == vars(Equirectangular(720, 150, 360.0))


def test_an_ordinary_camera_sees_60_degrees_and_a_lens_a_half_sphere_unless_more_is_known() -> None:
    camera, lens = Perspective.of_size(640, 480), Fisheye.of_size(640, 480)
    left, top = camera.unproject(np.array([[-0.5, 239.5], [319.5, -0.5]]))[0]
    assert math.degrees(math.atan2(left[1], left[0])) == pytest.approx(30.0)
    assert top[2] / top[0] == pytest.approx(0.75 * math.tan(math.pi / 6))  # of square pixels
    assert (lens.elevations[0], lens.elevations[1]) == (pytest.approx(QUARTER), pytest.approx(0.0))
