"""Odometry made worse: how much, and that it does not depend on how often one looks."""

import math

import numpy as np
import pytest

from omninav.pipeline import Context
from omninav.stages.geometry.plane.odometry_noise import add_odometry_noise
from omninav.stages.geometry.plane.se2 import chain
from omninav.stages.perturbation.odometry_noise import LEVELS, NoisyOdometry
from omninav.stages.values.pose import Motion

RUNS = 4000


def ends(motion: tuple[float, float, float], pieces: int, triple: tuple[float, float, float]) -> np.ndarray:
    """Where many robots believe to be after the same motions (RUNS, 3)."""
    rng = np.random.default_rng(4)
    motions = np.tile(motion, (pieces, 1))
    return np.array([chain(add_odometry_noise(motions, triple, rng.normal(size=(pieces, 3))))[-1] for _ in range(RUNS)])


def test_no_noise_leaves_every_motion_as_it_was():
    motions = np.random.default_rng(0).uniform(-1, 1, (50, 3))
    np.testing.assert_allclose(add_odometry_noise(motions, (0, 0, 0), np.ones((50, 3))), motions, atol=1e-12)


@pytest.mark.parametrize("pieces", [1, 20])
def test_a_metre_costs_what_the_triple_says_however_it_is_cut(pieces: int):
    end = ends((1.0 / pieces, 0.0, 0.0), pieces, (10.0, 0.0, 0.0))
    assert end[:, 0].std() == pytest.approx(0.010, rel=0.05)
    end = ends((1.0 / pieces, 0.0, 0.0), pieces, (0.0, 0.0, 5.0))
    assert math.degrees(end[:, 2].std()) == pytest.approx(5.0, rel=0.05)


@pytest.mark.parametrize("pieces", [1, 12])
def test_a_full_turn_on_the_spot_costs_what_the_triple_says(pieces: int):
    end = ends((0.0, 0.0, math.pi / 2 / pieces), pieces, (0.0, 5.0, 0.0))
    assert math.degrees(end[:, 2].std()) == pytest.approx(5.0 * math.sqrt(0.25), rel=0.05)


def test_a_robot_that_rolls_back_is_not_swung_round():
    noisy = add_odometry_noise(
        [[-1.0, 0.0, 0.0]] * RUNS, (10.0, 0.0, 5.0), np.random.default_rng(1).normal(size=(RUNS, 3))
    )
    assert noisy[:, 0].max() < -0.8
    assert np.abs(noisy[:, 1]).max() < 0.5


def test_levels_rise_from_none_to_the_papers_largest_over_the_two_it_prints():
    assert len(LEVELS) == 9
    assert LEVELS[0] == (0, 0, 0)
    assert LEVELS[-1] == (20, 20, 20)
    assert (10, 5, 5) in LEVELS
    assert (np.diff(np.array(LEVELS), axis=0) >= 0).all()
    assert np.sum(LEVELS, axis=0).tolist() == [82, 68, 68]


def test_the_stage_draws_from_the_runs_generator_and_level_0_changes_nothing():
    motion = Motion(0.3, 0.01, 0.1)

    def noisy(level: int) -> Motion:
        return NoisyOdometry(level=level).step(Context("n", np.random.default_rng(7)), motion).motion

    assert vars(noisy(8)) == vars(noisy(8)) != vars(motion)
    assert noisy(0).x == pytest.approx(motion.x)
    with pytest.raises(ValueError, match="no level 9; the levels are 0 to 8"):
        NoisyOdometry(level=9)
