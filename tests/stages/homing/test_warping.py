"""Homing by warping whole images, in a rendered world and where features tell nothing."""

import math
from dataclasses import replace

import numpy as np
import pytest
from turned_robot import CAMERA, look

from omninav.pipeline import BadInput, Context, Tick
from omninav.stages.camera.equirectangular import Equirectangular
from omninav.stages.camera.perspective import Perspective
from omninav.stages.homing.column_table import ColumnTable
from omninav.stages.homing.first_image import FirstImage, FirstImageState
from omninav.stages.homing.min_warping import (
    DEPTH_RATIOS,
    LOG_STEP,
    MAX_SHIFT,
    Columns,
    averaged_beside,
    column_distances,
    likelihood_ratios,
    places_of_columns,
    warped,
)
from omninav.stages.homing.warping import MinWarping, MinWarpingState
from omninav.stages.values.homing import HomingVector
from omninav.stages.values.image import Image

LOST = HomingVector(3, 0.0, 0.0, 1.0, 1.0, 1.0, None, 0, "lost", "2 matches")
TARGET = (5.0, 5.0, 0.4)


def seen(pose: tuple[float, float, float]) -> Image:
    return look("mirror", pose[2], *pose[:2])


def vector(stage: MinWarping, image: Image, target: Image, given: HomingVector = LOST) -> HomingVector:
    ctx = Context("homing")
    stage.setup(ctx)
    found = stage.step(ctx, MinWarpingState(), image, given, target, CAMERA).vector
    assert found is not None
    return found


@pytest.mark.parametrize("pose", [(4.4, 4.6, 2.0), (5.6, 4.4, -1.1)])
def test_it_points_to_where_the_target_was_taken_whatever_the_headings_are(pose: tuple[float, float, float]):
    found = vector(MinWarping(), seen(pose), seen(TARGET))
    direction = math.atan2(TARGET[1] - pose[1], TARGET[0] - pose[0]) - pose[2]
    assert abs(math.remainder(found.direction - direction, math.tau)) < math.radians(10)
    assert abs(math.remainder(found.turn - (TARGET[2] - pose[2]), math.tau)) < math.radians(6)
    assert (found.number, found.state, found.ratio, found.metres) == (3, "new", 1.0, None)


def test_it_is_nearer_where_less_of_the_way_is_left():
    stage, state, ctx, target = MinWarping(), MinWarpingState(), Context("homing"), seen(TARGET)
    stage.setup(ctx)
    vectors = [stage.step(ctx, state, seen((x, 4.6, 0.4)), LOST, target, CAMERA).vector for x in (4.2, 4.8)]
    assert vectors[0] is not None
    assert vectors[1] is not None
    assert vectors[1].depth_ratio < vectors[0].depth_ratio
    assert vectors[1].ratio == pytest.approx(vectors[1].depth_ratio / vectors[0].depth_ratio)
    back = stage.step(ctx, state, seen((4.8, 4.6, 0.4)), replace(LOST, number=4), seen((4.2, 4.6, 0.4)), CAMERA).vector
    assert (back.direction, back.turn, back.ratio) == pytest.approx((math.pi - 0.4, 0.0, 1.0), abs=math.radians(10))


@pytest.mark.parametrize(
    ("state", "inliers", "stays"),
    [
        ("tracking", 8, True),
        ("new", 18, True),
        ("new", 17, False),
        ("doubtful", 18, True),
        ("doubtful", 17, False),
        ("lost", 18, False),
    ],
)
def test_a_vector_on_which_enough_features_agree_is_given_on(state: str, inliers: int, stays: bool):
    given = replace(LOST, state=state, inliers=inliers, why="")
    assert (vector(MinWarping(), seen((4.4, 4.6, 2.0)), seen(TARGET), given) is given) == stays


def test_a_target_in_the_dark_stays_lost_and_says_why(monkeypatch: pytest.MonkeyPatch):
    rng = np.random.default_rng(1)
    noise = Image(rng.integers(0, 256, (CAMERA.height_px, CAMERA.width, 3)).astype(np.uint8))
    monkeypatch.setattr("omninav.stages.homing.warping.MIN_COLUMNS", 170)
    found = vector(MinWarping(), noise, seen(TARGET))
    assert found.state == "lost"
    assert found.why.startswith("2 matches; ")
    assert found.why.endswith("170 are needed")


def test_a_compass_limits_the_turn():
    here, there = seen((4.4, 4.6, 2.0)), seen(TARGET)
    within, beyond = (vector(MinWarping(max_turn_deg=limit), here, there) for limit in (100, 60))
    assert math.degrees(within.turn) == pytest.approx(math.degrees(0.4 - 2.0), abs=6)
    assert (beyond.state, abs(beyond.turn) <= math.radians(60)) == ("new", True)


def test_columns_differ_by_the_mean_square_of_the_rows_that_both_show_and_those_beside_count_too():
    rng = np.random.default_rng(0)
    views = [Columns(*(rng.random((5, rows, 3)).astype(np.float32) for rows in (8, 4))) for _ in range(2)]
    found = column_distances(*views)
    assert column_distances(*views[::-1]).transpose(1, 0, 2)[..., ::-1] == pytest.approx(found, abs=1e-6)
    for shift in (0, 2, 6):  # below the horizon there are not as many rows
        gaps = [a[:, None, shift:] - b[:, : max(b.shape[1] - shift, 0)] for a, b in zip(*views, strict=True)]
        off = np.square(np.concatenate(gaps, axis=2)).mean(axis=(2, 3))
        assert found[..., MAX_SHIFT + shift] == pytest.approx(off, abs=1e-6)
        beside = sum(np.roll(off, (step, step), (0, 1)) for step in (-1, 0, 1)) / 3
        assert averaged_beside(found)[..., MAX_SHIFT + shift] == pytest.approx(beside, abs=1e-6)
    assert np.isinf(found[..., 0]).all()
    ratios = likelihood_ratios(np.array([[[0.0, np.inf]]], np.float32))
    assert ratios == pytest.approx(np.array([[[2.0, 0.0]]]))


def test_columns_are_seen_where_geometry_says():
    columns, planes = places_of_columns(360)
    row = int(np.flatnonzero(DEPTH_RATIOS == 0.52)[0])
    assert planes[0, 0] == planes[180, 0]  # no way to the target: nothing changes
    assert columns[90, 0] == 90
    # straight ahead, half the way there: still ahead, 1 / 0.48 times as near; behind: 1.52 times as far
    assert (columns[0, row], columns[180, row]) == (0, 180)
    assert planes[0, row] < planes[0, 0] < planes[180, row]
    assert columns[90, row] == round(90 + math.degrees(math.atan(0.52)))


def test_views_that_differ_by_a_turn_alone_give_the_turn():
    rng = np.random.default_rng(0)
    above = np.repeat(rng.random((60, 30, 3)), 3, axis=0).astype(np.float32)
    nothing = np.zeros((180, 0, 3), np.float32)
    found = warped(Columns(above, nothing), Columns(np.roll(above, -40, axis=0), nothing))
    assert math.degrees(found.turn) == pytest.approx(80.0)
    assert found.depth_ratio < 0.05


def test_columns_are_the_image_by_steps_of_the_logarithm_of_the_tangent_of_elevation():
    up, down = math.radians(30.0), math.radians(10.0)
    strip = Equirectangular(180, 90, 90.0, elevation_top=up, elevation_bottom=-down)
    row, column = np.mgrid[:90, :180]
    pixels = np.stack([column, 2 * row, 0 * row], axis=-1).astype(np.uint8)
    for side, seen_rows, rows in zip((1.0, -1.0), ColumnTable(180).columns(pixels, strip), (31, 21), strict=True):
        elevations = np.arctan(math.tan(math.radians(1.0)) * np.exp(LOG_STEP * np.arange(rows)))
        assert seen_rows.shape == (180, rows, 3)
        assert 255 * seen_rows[1:90, :, 0] == pytest.approx(np.repeat(89.5 - np.arange(1, 90), rows).reshape(89, -1))
        there = 2.0 * ((up - side * elevations) * 90 / (up + down) - 0.5)
        assert 255 * seen_rows[40, :, 1] == pytest.approx(there, abs=0.6)


def test_a_camera_without_a_full_circle_is_refused():
    camera = Perspective(64, 48, 60.0, 60.0, 31.5, 23.5)
    with pytest.raises(BadInput, match="less than a full circle"):
        ColumnTable(180).columns(np.zeros((48, 64, 3), np.uint8), camera)


def test_the_first_image_is_given_once():
    stage, kept, ctx, image = FirstImage(), FirstImageState(), Context("first"), Image(np.zeros((4, 8, 3), np.uint8))
    assert stage.step(ctx, kept, Tick(index=1, stamp=1, frame=1), image).image is image  # the first tick had none
    assert stage.step(ctx, kept, Tick(index=2, stamp=2, frame=2), image).image is None
    assert stage.step(ctx, kept, Tick(index=3, stamp=0, log=1, first_of_log=True), image).image is image
