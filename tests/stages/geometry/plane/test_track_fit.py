import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omninav.stages.geometry.plane.se2 import chain, compose
from omninav.stages.geometry.plane.track_fit import agreement, track_fit

MOTIONS = np.column_stack([np.full(60, 0.3), np.zeros(60), 0.15 * np.sin(np.arange(60) / 5.0) + 0.05])
TRACK = chain(MOTIONS)
ELSEWHERE = np.array((3.0, -2.0, 1.0))


def placed(track):
    """The track as it lies in a map whose frame is another one."""
    return compose(ELSEWHERE, track)


def test_a_track_that_is_only_elsewhere_fits_as_it_is():
    fit = track_fit(TRACK, placed(TRACK), 0.5)
    assert fit is not None
    assert (fit.mirrored, fit.as_is) == ("", 1.0)
    assert fit.scale == pytest.approx(1.0)
    assert fit.angle == pytest.approx(0.0, abs=1e-9)
    changed = ((2.0**0.4, 0.0), (2.0**-0.4, 0.0), (2.0**0.6, 0.0), (1.0, 29.0), (1.0, 31.0))  # scale, degrees
    others = [placed(TRACK * (by, by, 1.0)) + np.radians((0.0, 0.0, turn)) for by, turn in changed]
    assert [track_fit(TRACK, other, 0.5).as_is for other in others] == [1.0, 1.0, 0.0, 1.0, 0.0]


def test_pairs_by_hand_of_a_straight_track():
    # 33 poses, 0.3 m apart: 29, 25, 17 and 1 pairs that moved by 1.2, 2.4, 4.8 and 9.6 m, of which 25 % are off.
    line = chain(np.tile([0.3, 0.0, 0.0], (33, 1)))
    assert [track_fit(line, line, least).pairs for least in (0.0, 2.0, 9.0)] == [72, 43, 1]
    assert agreement(line, line * 1.25, 1.0) == (pytest.approx(42 / 43), 43)


def test_pairs_across_a_leap_of_a_robot_that_hardly_drives_are_told_from_those_along_a_drive():
    step = np.clip(np.arange(60.0) - 26.0, 0.0, 8.0) / 8.0  # it drives 1 m
    line = np.column_stack([step, np.zeros((60, 2))])
    carried = line + np.where(np.arange(60)[:, None] < 30, 0.0, (1.2, 0.0, 0.0))
    leapt, drove = track_fit(line, carried, 1.3), track_fit(TRACK, placed(TRACK), 0.5)
    assert leapt.across == 1.0
    assert leapt.scale == pytest.approx(2.2)
    assert leapt.share > 0.5
    assert 0.2 < drove.across < 0.4  # a pair is 15 of 60 steps long in the mean


@given(st.floats(0.001, 1000.0), st.floats(-3.1, 3.1))
def test_scale_and_angle_are_found(scale, angle):
    there = placed(TRACK * (scale, scale, 1.0)) + np.array((0.0, 0.0, angle))
    fit = track_fit(TRACK, there, 0.0)
    assert fit is not None
    assert fit.mirrored == ""
    assert fit.scale == pytest.approx(scale, rel=1e-6)
    assert math.cos(fit.angle + angle) == pytest.approx(1.0, abs=1e-6)


def test_mirrored_positions_and_mirrored_poses_are_told_apart():
    positions = track_fit(TRACK * (1, -1, 1), placed(TRACK), 0.5)
    poses = track_fit(TRACK, placed(TRACK * (1, -1, -1)), 0.5)
    assert positions is not None
    assert poses is not None
    assert (positions.mirrored, positions.share) == ("positions", 1.0)
    assert (poses.mirrored, poses.share) == ("poses", 1.0)
    assert max(positions.as_is, poses.as_is) < 0.5


def test_a_third_of_right_matches_is_enough():
    rng = np.random.default_rng(0)
    there = placed(TRACK * (2.0, 2.0, 1.0))
    wrong = rng.random(len(there)) < 0.4  # of pairs a third is right
    there[wrong] = rng.uniform(-10.0, 10.0, (int(wrong.sum()), 3))
    fit = track_fit(TRACK, there, 0.5)
    assert fit is not None
    assert fit.scale == pytest.approx(2.0, rel=0.02)
    assert 0.3 < fit.share < 0.5
    assert fit.as_is < 0.1


def test_pairs_agree_where_both_their_poses_are_right():
    rng = np.random.default_rng(0)
    there = placed(TRACK)
    assert agreement(TRACK, there, 0.3).share == 1.0
    wrong = rng.random(len(there)) < 0.5
    there[wrong] = rng.uniform(-20.0, 20.0, (int(wrong.sum()), 3))
    fit = agreement(TRACK, there, 0.3)
    assert fit.share == pytest.approx(0.25, abs=0.1)
    assert fit.pairs > 100
    turned = placed(TRACK) + np.arange(60)[:, None] * np.array((0.0, 0.0, 0.3))
    assert agreement(TRACK, turned, 0.3).share == 0.0  # where headings are wrong too
    assert agreement(TRACK, there, 100.0) == (0.0, 0)


def test_a_robot_that_stands_says_nothing():
    assert track_fit(TRACK, np.zeros_like(TRACK), 0.5) is None
