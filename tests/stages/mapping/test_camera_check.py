import math
from dataclasses import replace

import numpy as np
import pytest
from landmark_world import NOISE, house
from made_words import features_of

from omninav.pipeline import Context
from omninav.stages.camera.cylindrical import Cylindrical
from omninav.stages.camera.equirectangular import Equirectangular
from omninav.stages.camera.hyperbolic import HyperbolicMirror
from omninav.stages.camera.perspective import Perspective
from omninav.stages.camera.self_calibration import adjustable
from omninav.stages.geometry.landmarks.adjustment import adjusted, rotations_about
from omninav.stages.geometry.landmarks.leaning_images import Levelling
from omninav.stages.geometry.landmarks.map_making import LocalViews, PairMatches
from omninav.stages.geometry.plane.se2 import turned
from omninav.stages.mapping.camera_check import MIN_VIEWS, CameraCheck
from omninav.stages.recordings.camera_yaml import parse_camera

TRUE = HyperbolicMirror(640, 480, 497.0, 497.0, 319.5, 239.5, 28.095, 23.4125, 34.0, 238.0, height=0.9, yaw=0.3)
SPHERE = Equirectangular(1024, 512, 512.0, elevation_top=math.pi / 2, elevation_bottom=-math.pi / 2)
BESIDE = replace(TRUE, centre_x=321.8, centre_y=237.6)  # by 3 pixels


def check_of(camera, pixels, views=MIN_VIEWS):
    rays = adjustable(camera, pixels).bearings(np.zeros(2)) if camera.ring else camera.unproject(pixels)[0]
    features = replace(features_of(np.zeros((len(pixels), 128), np.uint8)), bearings=rays, points=pixels)
    return CameraCheck.of(camera, [*[None] * (views - 1), features], rays, poses_given=True)


@pytest.fixture(scope="module")
def seen():
    """Pixels of a house's points, and the world."""
    world = house(np.random.default_rng(0))
    return TRUE.project(world.bearings)[0], world


def corrections(check, world):
    held = np.zeros((len(world.poses), 3))
    lens = check.seen(np.arange(len(world.bearings)))
    return adjusted(world.poses, world.points, world.references, world.landmarks, lens, NOISE, held).camera


def told(ctx, check, found):
    return check.told(ctx, check.camera, found, np.array([0.0, 0.0, check.yaw_beside(found)]), 0.0)


def test_bearings_of_the_adjustment_are_those_of_the_map_where_images_lean_and_the_yaw_is_wrong(seen):
    pixels, _ = seen
    rng, described = np.random.default_rng(1), check_of(TRUE, pixels)
    tilts = rng.normal(0.0, math.radians(3.0), (2, len(pixels)))
    levelling = Levelling(rotations_about(tilts[0], 1) @ rotations_about(tilts[1], 0), np.full(len(pixels), 0.01))
    check, wrong = described._replace(levelling=levelling), np.zeros(len(described.fields) + 2)
    wrong[list(check.fields).index("yaw")] = 0.5
    views = LocalViews(np.array([0, len(pixels)]), check.bearings, np.empty((0, 128), np.uint8))
    adjusted_to = check.seen(np.arange(len(pixels))).bearings(wrong)
    assert turned(check.levelled(views, wrong).bearings, 0.5) == pytest.approx(adjusted_to, abs=1e-9)


def test_an_axis_beside_is_said_and_the_right_camera_is_given(seen):
    pixels, world = seen
    ctx, check = Context("landmarks"), check_of(BESIDE, pixels)
    found = corrections(check, world)
    right = parse_camera(told(ctx, check, found), "camera.yaml")
    assert (right.centre_x, right.centre_y) == pytest.approx((319.5, 239.5), abs=0.05)
    assert (right.yaw, right.height) == (0.3, 0.9)
    assert "its axis is off by 3.0 px, at 319.5, 239.5" in ctx.warnings[0]
    assert check.metrics(found, np.zeros(3), 0.0)["camera"]["axis_beside_px"] == pytest.approx(2.98, abs=0.05)
    views = LocalViews(np.array([0, len(pixels)]), check.bearings, np.empty((0, 128), np.uint8))
    away, before = (np.abs(each.bearings - TRUE.unproject(pixels)[0]) for each in (check.levelled(views, found), views))
    assert np.nanmax(away) < 0.1 * np.nanmax(before)


def test_a_camera_that_is_turned_is_said(seen):
    pixels, world = seen
    ctx, check = Context("landmarks"), check_of(replace(TRUE, yaw=0.2), pixels)
    right = parse_camera(told(ctx, check, corrections(check, world)), "camera.yaml")
    assert right.yaw == pytest.approx(0.3, abs=0.001)
    assert (right.centre_x, right.centre_y) == (319.5, 239.5)
    assert "turned by 5.7 degrees more" in ctx.warnings[0]


def test_of_a_camera_as_it_is_described_nothing_is_said(seen):
    pixels, world = seen
    ctx, check = Context("landmarks"), check_of(TRUE, pixels)
    assert told(ctx, check, corrections(check, world)) == ""
    assert not ctx.warnings


@pytest.mark.parametrize("camera", [TRUE, SPHERE], ids=["mirror", "sphere"])
def test_a_camera_that_leans_is_said(camera):
    world = house(np.random.default_rng(0))
    roll, pitch = math.radians(-3.0), math.radians(0.5)
    about_x = [[1.0, 0.0, 0.0], [0.0, math.cos(roll), -math.sin(roll)], [0.0, math.sin(roll), math.cos(roll)]]
    about_y = [[math.cos(pitch), 0.0, math.sin(pitch)], [0.0, 1.0, 0.0], [-math.sin(pitch), 0.0, math.cos(pitch)]]
    mounted = np.array(about_y) @ about_x  # its upper end to the left, y, and a little forward
    pixels, shown = camera.project(world.bearings @ mounted)
    ctx, check = Context("landmarks"), check_of(camera, pixels)
    found = corrections(check, world)
    assert told(ctx, check, found) == ""
    assert "leans by 0.5 degrees forward and 3.0 to the left" in ctx.warnings[0]
    assert check.metrics(found, np.zeros(3), 0.0)["camera"]["tilt_deg"] == pytest.approx(3.04, abs=0.02)
    views = LocalViews(np.array([0, len(world.bearings)]), check.bearings, np.empty((0, 128), np.uint8))
    level = check.levelled(views, found).bearings
    np.testing.assert_allclose(level[shown], world.bearings[shown], atol=0.003)


def test_bearings_of_other_pixels_cameras_of_a_part_of_the_circle_and_few_views_are_not_checked(seen):
    pixels, _ = seen
    check = check_of(TRUE, pixels)
    other = CameraCheck.of(BESIDE, [None] * MIN_VIEWS, check.bearings, poses_given=True)
    ahead = check_of(Perspective(640, 480, 400.0, 400.0, 319.5, 239.5), np.full((5, 2), 100.0))
    short = check_of(BESIDE, pixels, MIN_VIEWS - 1)
    for each in (other, ahead, short, CameraCheck.of(None, [None], np.empty((0, 3)), poses_given=False)):
        assert each.camera is None
        assert each.metrics(np.empty(0), np.zeros(3), 0.0) == {}
        assert each.seen(np.arange(0)).sigmas.shape == (0,)


def strip_told(top, described):
    """Returns the warnings and the camera.yaml for a strip whose upper edge truly lies at `top` (rad)."""
    world = house(np.random.default_rng(0))
    true = Equirectangular(720, 300, 360.0, elevation_top=top, elevation_bottom=top - math.radians(150.0))
    pixels, seen = true.project(world.bearings)
    rows = np.flatnonzero(seen)
    rows = rows[np.argsort(world.references[rows], kind="stable")]
    bearings = described.unproject(pixels[rows])[0]
    owners, landmarks = world.references[rows], world.landmarks[rows]
    starts = np.searchsorted(owners, np.arange(len(world.poses) + 1))
    views = LocalViews(starts, bearings, np.zeros((len(rows), 1), np.uint8))
    pairs = np.column_stack([np.arange(len(world.poses) - 1), np.arange(1, len(world.poses))])
    shared = []
    for one, other in pairs:
        seen_by = landmarks[views.rows(one)], landmarks[views.rows(other)]
        _, first, second = np.intersect1d(*seen_by, return_indices=True)
        shared.append((first + starts[one], second + starts[other]))
    lengths = np.cumsum([0, *(len(first) for first, _ in shared)])
    first, second = (np.concatenate([each[n] for each in shared]) for n in (0, 1))
    matches = PairMatches(pairs, lengths, first, second, np.zeros(len(first)))
    ctx = Context("landmarks")
    check = CameraCheck(None, {}, pixels[rows], bearings)
    return ctx.warnings, check.elevations_told(ctx, described, views, matches, world.poses)


def test_the_horizon_of_a_strip_that_does_not_say_it_is_found():
    unsaid = Cylindrical(720, 300, 360.0)
    warnings, file = strip_told(math.radians(90.0), unsaid)
    assert np.degrees(parse_camera(file, "camera.yaml").elevations) == pytest.approx((90.0, -60.0), abs=0.5)
    assert "its rows go from 90.0 to -60.0 degrees" in warnings[0]


def test_elevations_that_are_right_or_said_stay():
    assert strip_told(math.radians(75.0), Cylindrical(720, 300, 360.0)) == ([], "")
    said = Cylindrical(720, 300, 360.0, elevation_top=1.0, elevation_bottom=-1.0)
    assert strip_told(math.radians(90.0), said) == ([], "")
