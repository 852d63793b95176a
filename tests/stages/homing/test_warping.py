"""Homing by warping whole images, in a rendered world and where features tell nothing."""

import math
from dataclasses import replace

import numpy as np
import pytest
from turned_robot import CAMERA, look

from omninav.pipeline import BadInput, Context, Tick
from omninav.stages.camera.perspective import Perspective
from omninav.stages.homing.column_table import ColumnTable
from omninav.stages.homing.first_image import FirstImage
from omninav.stages.homing.min_warping import DEPTH_RATIOS, Columns, places_of_columns, warped
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


def test_a_camera_without_a_full_circle_is_refused():
    camera = Perspective(64, 48, 60.0, 60.0, 31.5, 23.5)
    with pytest.raises(BadInput, match="less than a full circle"):
        ColumnTable(180).columns(np.zeros((48, 64, 3), np.uint8), camera)


def test_the_first_image_is_given_once():
    stage, ctx, image = FirstImage(), Context("first"), Image(np.zeros((4, 8, 3), np.uint8))
    assert stage.step(ctx, Tick(index=0, stamp=0, frame=0, first_of_log=True), image).image is image
    assert stage.step(ctx, Tick(index=1, stamp=1, frame=1, first_of_log=False), image).image is None
