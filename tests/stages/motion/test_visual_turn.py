"""Turns of odometry that are corrected by what the images show."""

import math

import cv2
import numpy as np
import pytest

from omninav.pipeline import Context
from omninav.stages.motion.visual_turn import VisualTurn, VisualTurnState, _line, smoothness, turn_by_flow
from omninav.stages.values.image import Panorama
from omninav.stages.values.pose import AssumedMotion, Motion

COLUMNS, ROWS = 360, 80
RNG = np.random.default_rng(0)
POSTS = np.column_stack([RNG.uniform(-6.0, 6.0, (400, 2)), RNG.uniform(-1.5, 1.5, 400)])
SHADES = RNG.uniform(0, 255, 400)


def panorama(x, y, heading):
    """Bright and dark posts at all distances, seen all around."""
    image = np.full((4 * ROWS, 4 * COLUMNS), 128, np.uint8)
    gap = POSTS[:, :2] - [x, y]
    far = np.hypot(*gap.T)
    for post in np.argsort(-far):
        if far[post] < 0.7:
            continue
        azimuth = math.remainder(math.atan2(gap[post, 1], gap[post, 0]) - heading, 2 * math.pi)
        column = (math.pi - azimuth) / (2 * math.pi) * 4 * COLUMNS
        row = (0.5 - math.atan2(POSTS[post, 2], far[post]) / 1.6) * 4 * ROWS
        for shift in (-4 * COLUMNS, 0, 4 * COLUMNS):
            centre = (round(16 * (column + shift)), round(16 * row))
            cv2.circle(image, centre, round(16 * 30 / far[post]), float(SHADES[post]), -1, cv2.LINE_AA, 4)
    small = cv2.resize(image, (COLUMNS, ROWS), interpolation=cv2.INTER_AREA)
    return Panorama(np.repeat(small[..., None], 3, axis=2))


BEFORE, TURN = panorama(0.0, 0.0, 0.3), 0.1
AFTER = panorama(0.2 * math.cos(0.35), 0.2 * math.sin(0.35), 0.3 + TURN)


def corrected(motion, before=BEFORE, after=AFTER, **options):
    stage, state, ctx = VisualTurn(**options), VisualTurnState(), Context("turn", np.random.default_rng(0))
    assert stage.step(ctx, before, None, state).motion is None
    return stage.step(ctx, after, motion, state).motion


@pytest.mark.parametrize("guess", [0.0, 0.1, 0.2])
def test_the_turn_is_seen_although_what_is_near_moves_by(guess):
    seen = turn_by_flow(BEFORE.pixels[..., 0], AFTER.pixels[..., 0], guess, 0.05)
    assert seen.turn == pytest.approx(TURN, abs=math.radians(0.3))
    assert seen.sigma < math.radians(0.2)


def test_smoothness_compares_pixels_two_columns_apart_with_neighbours_all_around():
    assert smoothness(np.array([[0, 0, 9, 9]], np.uint8)) == 2.0  # 1 of 1 against 1 of 2
    assert smoothness(np.array([[0, 9, 0, 9], [0, 9, 9, 9]], np.uint8)) == pytest.approx(2 / 6)
    assert smoothness(np.full((2, 4), 7, np.uint8)) == 0.0


def test_a_line_through_flow_is_as_sure_as_its_points_are_alike_and_outliers_hardly_count():
    sines, off = np.array([-0.6, -0.6, 0.6, 0.6, -0.2, -0.2, 0.2, 0.2]), 0.003 * np.tile([1.0, -1.0], 4)
    weights = np.array([1.0, 1.0, 1.0, 1.0, 4.0, 4.0, 4.0, 4.0])
    level, sigma = _line(sines, 0.1 + 0.5 * sines + off, weights)
    scale = 1.5 * 0.003 + 1e-5  # one and a half of the median gap
    counted = 1.0 / (1.0 + (0.003 / scale) ** 2)  # by Cauchy's loss
    assert (level, sigma) == pytest.approx((0.1, scale / math.sqrt(20.0 * counted)))
    worse = _line(np.append(sines, 0.2), np.append(0.1 + 0.5 * sines + off, 3.0), np.append(weights, 4.0))
    assert worse[0] == pytest.approx(0.1, abs=0.001)


def test_a_wrong_turn_of_odometry_is_corrected_and_its_translation_turned_by_half():
    error = 0.03
    motion = corrected(Motion(0.2 * math.cos(0.05 + error / 2), 0.2 * math.sin(0.05 + error / 2), TURN + error))
    assert motion.turn == pytest.approx(TURN, abs=0.006)
    assert math.atan2(motion.y, motion.x) == pytest.approx(0.05, abs=0.004)
    assert math.hypot(motion.x, motion.y) == pytest.approx(0.2)


def test_a_turn_is_seen_ahead_and_behind_of_a_robot_that_drives_sideways():
    after = panorama(0.2 * math.cos(0.3 + 1.2), 0.2 * math.sin(0.3 + 1.2), 0.3 + TURN)
    for error in (0.0, 0.03):
        motion = corrected(Motion(0.2 * math.cos(1.2), 0.2 * math.sin(1.2), TURN + error), after=after)
        assert motion.turn == pytest.approx(TURN, abs=0.006)


def test_a_visual_turn_far_from_the_measured_one_is_hardly_believed():
    assert corrected(Motion(0.2, 0.0, TURN + 0.3)).turn == pytest.approx(TURN + 0.3, abs=0.03)


def test_nothing_to_see_leaves_odometry_alone():
    grey = Panorama(np.full((ROWS, COLUMNS, 3), 90, np.uint8))
    motion = Motion(0.2, 0.0, 0.1)
    assert corrected(motion, grey, grey) is motion
    assert corrected(motion, max_sigma_deg=0.0) is motion


def test_strips_of_few_columns_leave_odometry_alone(monkeypatch: pytest.MonkeyPatch):
    few = [
        Panorama(cv2.resize(cv2.resize(view.pixels, (90, 20), interpolation=cv2.INTER_AREA), (COLUMNS, ROWS)))
        for view in (BEFORE, AFTER)
    ]
    motion = Motion(0.2, 0.0, 0.13)
    assert corrected(motion, *few) is motion
    monkeypatch.setattr("omninav.stages.motion.visual_turn.MAX_SMOOTHNESS", 4.0)
    assert corrected(motion, *few) is not motion


@pytest.mark.parametrize("shape", [(1, 1, 3), (1, 8, 3), (80, 3, 3), (2, 360, 3)])
def test_panoramas_of_few_pixels_are_no_error(shape):
    noise = [Panorama(np.random.default_rng(n).integers(0, 255, shape, np.uint8)) for n in range(2)]
    assert np.isfinite(corrected(Motion(0.2, 0.0, 0.1), *noise).turn)


def test_a_guessed_turn_becomes_as_sure_as_what_was_seen():
    motion = corrected(AssumedMotion(0.2, 0.0, 0.05, 0.5, 0.2))
    assert motion.turn == pytest.approx(TURN, abs=0.006)
    assert motion.sigma_turn < 0.02
