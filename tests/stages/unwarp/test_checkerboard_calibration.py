"""Cameras from the corners of a checkerboard, projected through cameras that are known."""

import math

import numpy as np
import pytest
from made_boards import COLUMNS, LENS, MIRROR, ROWS, boards, seen, worst_deg
from scipy.spatial.transform import Rotation

from omninav.pipeline import BadInput
from omninav.stages.camera.model import Camera, Ring
from omninav.stages.unwarp.checkerboard_calibration import (
    FAR_PX,
    SHAPES,
    TOP_DEG,
    BoardFit,
    _placed,
    _residuals,
    board_points,
    calibrated,
    lens_camera,
    lens_starts,
    mirror_camera,
    mirror_starts,
    polynomial_camera,
    polynomial_start,
)

SIZE, RING = (640, 480), Ring(322.0, 236.0, 34.0, 238.0)
BOARD = board_points(COLUMNS, ROWS)


def elevations_deg(camera: Camera, radius: float | np.ndarray) -> np.ndarray:
    """Elevations at distances from the ring's centre along a row of the image."""
    radii = np.atleast_1d(radius)
    rays, _ = camera.unproject(np.stack([RING.centre_x + radii, np.full(len(radii), RING.centre_y)], axis=1))
    return np.degrees(np.arcsin(rays[:, 2]))


@pytest.mark.parametrize("k", [1.001, 1.3, 20.0])
def test_a_mirror_by_five_numbers_is_that_of_the_unified_model(k: float) -> None:
    camera = mirror_camera(SIZE, RING, np.array([200.0, 220.0, 322.0, 236.0, math.log(k - 1.0)]))
    x, y, z = 2.0, -1.5, -0.7
    depth = math.sqrt(x * x + y * y + z * z) - k * z
    assert camera.ring == RING
    assert camera.project(np.array([x, y, z]))[0] == pytest.approx(
        [322.0 + 200.0 * x / depth, 236.0 + 220.0 * y / depth]
    )


def test_starts_put_the_rim_at_the_elevations_that_are_tried() -> None:
    k, top = np.array(
        [(k, math.radians(top)) for k in SHAPES for top in TOP_DEG if k * math.sin(math.radians(top)) < 1]
    ).T
    starts = np.array(mirror_starts(RING))
    assert 1.0 + np.exp(starts[:, 4]) == pytest.approx(k)
    for gamma in starts[:, :2].T:  # the unified model's radius of a ray at that elevation
        assert gamma * np.cos(top) / (1.0 - k * np.sin(top)) == pytest.approx(np.full(len(k), RING.outer))
    assert (starts[:, 2:4] == RING[:2]).all()
    lenses = [lens_camera(SIZE, RING, start) for start in lens_starts(RING)]
    assert [90.0 - elevations_deg(lens, RING.outer)[0] for lens in lenses] == pytest.approx([60, 80, 90, 100, 110])
    assert {lens.ring for lens in lenses} == {RING}


def test_a_polynomial_s_numbers_are_in_units_of_the_outer_radius() -> None:
    camera = polynomial_camera(SIZE, RING, np.array([322.0, 236.0, 1.1, 0.2, -0.4, 0.6, -0.05, 0.03]))
    column, row = 60.0, -80.0  # of a radius of 100
    share = 100.0 / RING.outer
    height = RING.outer * (-0.4 + 0.6 * share**2 - 0.05 * share**3 + 0.03 * share**4)
    ray, _ = camera.unproject(np.array([322.0 + column, 236.0 + 1.1 * row + 0.2 * column]))
    assert ray == pytest.approx(np.array([column, row, height]) / math.hypot(100.0, height))
    assert camera.ring == RING


@pytest.mark.parametrize("inner", [0.0, RING.inner])
def test_a_polynomial_starts_as_its_mirror(inner: float) -> None:
    ring = RING._replace(inner=inner)
    mirror = mirror_camera(SIZE, ring, np.array([200.0, 220.0, 322.0, 236.0, math.log(0.2)]))
    start = polynomial_start(ring, mirror)
    assert start[:4] == pytest.approx([322.0, 236.0, 1.1, 0.0])
    radii = np.linspace(RING.inner, RING.outer, 30)
    assert elevations_deg(polynomial_camera(SIZE, RING, start), radii) == pytest.approx(
        elevations_deg(mirror, radii), abs=0.01
    )


@pytest.mark.parametrize(("camera", "elevation"), [(MIRROR, -0.1), (LENS, 0.4)])
def test_boards_are_placed_where_they_are(camera: Camera, elevation: float) -> None:
    found = np.stack(seen(camera, elevation))
    poses = _placed(camera, found, BOARD)
    true = [np.append(Rotation.from_matrix(turn).as_rotvec(), place) for turn, place in boards(elevation)]
    assert poses == pytest.approx(np.array(true), abs=1e-9)
    off = np.zeros_like(found)
    off[3, 4] = 3.0, -4.0
    off[5, 1] = 3.0 * FAR_PX, 0.0
    errors = _residuals(camera, poses, BOARD, found - off)
    assert errors == pytest.approx(np.minimum(off, FAR_PX), abs=1e-6)
    assert BoardFit(camera, errors[:4], poses[:4]).rms_px == pytest.approx([0, 0, 0, math.sqrt(25 / 30)], abs=1e-6)


def test_a_corner_that_no_ray_meets_counts_as_far_off() -> None:
    found = np.stack(seen(MIRROR, -0.1))
    found[2, 7] = MIRROR.centre_x + 2000.0, MIRROR.centre_y
    assert _placed(MIRROR, found, BOARD) is None
    overhead = np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 5.0]])
    assert (_residuals(MIRROR, overhead, BOARD[:1], found[:1, :1]) == FAR_PX).all()


@pytest.mark.parametrize(("projection", "true"), [("hyperbolic", MIRROR), ("ocamcalib", MIRROR), ("fisheye", LENS)])
def test_exact_corners_give_the_camera_back(projection: str, true: Camera) -> None:
    ring = true.ring._replace(centre_x=330.0, centre_y=230.0)
    elevation = 0.4 if projection == "fisheye" else -0.1
    found = calibrated(projection, SIZE, ring, seen(true, elevation), BOARD)
    assert found.rms_px.max() < 0.05
    assert worst_deg(found.camera, true) < 0.1


def test_one_board_that_is_wrong_does_not_bend_the_camera() -> None:
    corners = seen(MIRROR, -0.1)
    corners[2] = corners[2] + np.random.default_rng(0).normal(0, 6.0, corners[2].shape)
    found = calibrated("hyperbolic", SIZE, MIRROR.ring, corners, BOARD)
    assert np.argmax(found.rms_px) == 2
    assert worst_deg(found.camera, MIRROR) < 0.5


def test_three_boards_are_enough_and_two_too_few() -> None:
    corners = seen(MIRROR, -0.1)
    assert calibrated("hyperbolic", SIZE, MIRROR.ring, corners[:3], BOARD).rms_px.max() < 0.05
    with pytest.raises(BadInput, match="3 different views of the board are needed, 2 found"):
        calibrated("hyperbolic", SIZE, MIRROR.ring, corners[:2], BOARD)


def test_corners_that_no_start_explains_are_refused() -> None:
    far = [np.full((len(BOARD), 2), 5000.0)] * 3
    with pytest.raises(BadInput, match="no fisheye camera explains these boards"):
        calibrated("fisheye", SIZE, RING, far, BOARD)
