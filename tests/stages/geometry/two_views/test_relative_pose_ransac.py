"""Relative poses where half of the pairs are wrong."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from two_views import angle_deg, two_views, unit

from omninav.stages.geometry.two_views.relative_pose_ransac import (
    SAMPLE,
    Solver,
    agreement,
    false_alarms,
    refined_pose,
    relative_pose,
)

SEEDS = st.integers(0, 10**6)


def errors(solver: Solver, seed: int, **how) -> tuple[float, float]:
    rotation, translation, first, second = two_views(seed, 100, wrong=0.5, noise_deg=0.1)
    found = relative_pose(first, second, np.random.default_rng(seed), solver, **how)
    assert found is not None
    return angle_deg(found.rotation, rotation), angle_deg(found.translation, translation)


@settings(max_examples=60)
@given(SEEDS)
def test_the_pose_of_a_robot_on_a_floor_is_found_among_as_many_wrong_pairs(seed: int) -> None:
    turn, way = errors("planar", seed)
    assert turn < 0.5
    assert way < 1.0


@pytest.mark.parametrize("solver", ["five_point", "eight_point"])
def test_any_pose_is_found_among_as_many_wrong_pairs(solver: Solver) -> None:
    for seed in range(4):
        rotation, translation, first, second = two_views(seed, 100, wrong=0.5, noise_deg=0.1, planar=False)
        found = relative_pose(first, second, np.random.default_rng(0), solver)
        assert found is not None
        assert angle_deg(found.rotation, rotation) < 0.5
        assert angle_deg(found.translation, translation) < 1.0
        assert found.inliers[50:].mean() > 0.95
        assert found.inliers[:50].mean() < 0.1


def test_two_points_err_by_no_more_than_five() -> None:
    """The measured anchor: OpenGV's 5-point RANSAC has 0.22 to 0.27 and 0.45 to 0.55 degrees on such scenes."""
    two = np.median([errors("planar", seed) for seed in range(60)], axis=0)
    five = np.median([errors("five_point", seed) for seed in range(60)], axis=0)
    assert (two <= five).all()
    assert (two <= [0.22, 0.45]).all()


def test_the_local_optimum_is_better_than_the_best_sample() -> None:
    rough = np.median([errors("planar", seed, refine=False) for seed in range(40)], axis=0)
    fine = np.median([errors("planar", seed) for seed in range(40)], axis=0)
    assert (fine < 0.7 * rough).all()


@given(SEEDS, st.floats(-0.004, 0.004), st.floats(-0.004, 0.004))
def test_refinement_comes_back_to_the_true_pose(seed: int, turned: float, aside: float) -> None:
    rotation, translation, first, second = two_views(seed, 60)
    cos, sin = math.cos(turned), math.sin(turned)
    off = rotation @ np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    off_way = unit(translation + aside * np.array([-translation[1], translation[0], 0.0]))
    for planar in (True, False):
        found = refined_pose(off, off_way, first, second, math.radians(2.0), planar, steps=30)
        assert angle_deg(found[0], rotation) < 1e-3
        assert angle_deg(found[1], translation) < 1e-3


def test_far_points_agree_whatever_noise_makes_of_their_depth_and_near_ones_behind_do_not() -> None:
    ahead = unit(np.array([[1.0, 0.3, 0.2]]))
    back = unit(ahead - 0.001 * np.array([1.0, 0.0, 0.0]) * [1.0, 1.0, 1.0])
    forth = np.array([1.0, 0.0, 0.0])
    assert agreement(np.eye(3), forth, ahead, back, math.radians(0.5))[0]
    assert agreement(np.eye(3), -forth, ahead, back, math.radians(0.5))[0]
    near = unit(np.array([[1.0, 2.0, 0.5]]))
    seen = unit(near * 2.0 - forth)
    assert agreement(np.eye(3), forth, near, seen, math.radians(0.5))[0]
    assert not agreement(np.eye(3), -forth, near, seen, math.radians(0.5))[0]


def test_more_wrong_pairs_ask_for_more_samples() -> None:
    drawn = []
    for wrong in (0.0, 0.5, 0.8):
        _, _, first, second = two_views(3, 100, wrong=wrong, noise_deg=0.1)
        found = relative_pose(first, second, np.random.default_rng(0))
        assert found is not None
        drawn.append(found.samples)
    assert drawn[0] <= drawn[1] < drawn[2]


def test_the_same_seed_gives_the_same_pose() -> None:
    _, _, first, second = two_views(5, 100, wrong=0.5, noise_deg=0.1)
    for solver in SAMPLE:
        one, two = (relative_pose(first, second, np.random.default_rng(7), solver, max_samples=64) for _ in range(2))
        assert one is not None
        assert two is not None
        assert np.array_equal(one.rotation, two.rotation)
        assert np.array_equal(one.translation, two.translation)
        assert np.array_equal(one.inliers, two.inliers)


def test_too_few_pairs_say_nothing() -> None:
    _, _, first, second = two_views(0, 8)
    for solver, size in SAMPLE.items():
        assert relative_pose(first[: size - 1], second[: size - 1], np.random.default_rng(0), solver) is None
    level = np.tile([[1.0, 0.0, 0.0]], (5, 1))
    assert relative_pose(level, level, np.random.default_rng(0)) is None


def test_poses_that_wrong_pairs_agree_on_are_told_from_true_ones() -> None:
    limit, by_chance, true = math.radians(1.0), [], []
    for seed in range(30):
        for wrong, alarms in ((1.0, by_chance), (0.5, true)):
            _, _, first, second = two_views(seed, 24, wrong=wrong, noise_deg=0.2)
            found = relative_pose(first, second, np.random.default_rng(seed), threshold=limit)
            assert found is not None
            alarms.append(false_alarms(found, first, second, limit))
    assert max(true) < 1e-3
    assert np.mean(np.array(by_chance) < 1.0) <= 0.2  # expected: once in each problem at the most
    assert min(by_chance) > 1e-3


def test_two_pairs_say_nothing_of_a_pose() -> None:
    _, _, first, second = two_views(0, 2)
    found = relative_pose(first, second, np.random.default_rng(0))
    assert found is not None
    assert false_alarms(found, first, second, 0.01) == math.inf
