import math

import numpy as np
import pytest

from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.geometry.probability.particles import is_narrow, mode_and_mean, weighted_moments
from omninav.stages.values.belief import MODE_RADIUS


def heaviest_start_by_brute_force(poses, weights, radius=1.0):
    """Every cell of radius / 2 and 30 degrees with all 26 around it, headings circular: the heaviest sum wins."""
    mass = {}
    for pose, weight in zip(poses, weights, strict=True):
        key = (
            *(int(np.floor(pose[axis] / (radius / 2))) for axis in (0, 1)),
            int(pose[2] % (2 * np.pi) // (np.pi / 6)),
        )
        mass[key] = mass.get(key, 0.0) + weight

    def around(cell):
        near = (other for other in mass if max(abs(other[0] - cell[0]), abs(other[1] - cell[1])) <= 1)
        return sum(mass[other] for other in near if (other[2] - cell[2]) % 12 in (0, 1, 11))

    return max(mass, key=around)


@pytest.mark.parametrize("seed", range(5))
def test_the_mode_grows_from_the_cell_that_a_search_over_all_cells_finds(seed):
    rng = np.random.default_rng(seed)
    centres = np.array([[0.0, 0.0, 3.1], [7.0, -3.0, 0.0], [-40.0, 12.0, -1.0]])
    poses = centres[rng.integers(0, 3, 300)] + rng.normal(0, [0.4, 0.4, 0.2], (300, 3))
    weights = rng.random(300)
    cell = heaviest_start_by_brute_force(poses, weights / weights.sum())
    start = np.array([(cell[0] + 0.5) * 0.5, (cell[1] + 0.5) * 0.5])
    mode, _, share, _ = mode_and_mean(poses, weights, *MODE_RADIUS)
    assert np.hypot(*(mode[:2] - start)) < 1.5
    assert 0.2 < share < 0.6


def test_of_two_clusters_the_heavier_is_the_mode_and_not_the_mean_between():
    poses = np.array([[0.0, 0.0, 0.0]] * 3 + [[10.0, 0.0, 0.0]] * 5)
    mode, covariance, share, _ = mode_and_mean(poses, np.full(8, 1 / 8), *MODE_RADIUS)
    np.testing.assert_allclose(mode, [10.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(covariance, 0.0, atol=1e-12)
    assert share == pytest.approx(5 / 8)


def test_moments_by_hand_around_the_cut():
    # Half the weight in the middle: half of the squares of (2, 1, 0.2).
    poses, weights = (
        np.array([[0.0, 0.0, np.pi - 0.2], [4.0, 2.0, np.pi + 0.2], [2.0, 1.0, np.pi]]),
        np.array([1, 1, 2]),
    )
    mean, covariance = weighted_moments(poses, weights)
    assert np.abs(mean) == pytest.approx([2.0, 1.0, np.pi])
    assert covariance == pytest.approx(np.array([[2.0, 1.0, 0.2], [1.0, 0.5, 0.1], [0.2, 0.1, 0.02]]))
    assert [is_narrow(poses, weights, sigma) for sigma in (1.58, 1.59)] == [False, True]  # sqrt(2.5)


def test_headings_on_both_sides_of_the_cut_are_one_mode():
    heading = np.concatenate([np.full(5, np.pi - 0.05), np.full(5, -np.pi + 0.05)])
    poses = np.column_stack([np.zeros(10), np.zeros(10), heading])
    mode, _, share, _ = mode_and_mean(poses, np.full(10, 0.1), *MODE_RADIUS)
    assert abs(wrap(mode[2] - np.pi)) < 1e-9
    assert share == pytest.approx(1.0)


def test_a_mode_far_from_the_origin_is_found_as_well():
    rng = np.random.default_rng(0)
    poses = rng.normal([5e5, -4e6, 1.0], 0.1, (50, 3))
    mode, _, share, _ = mode_and_mean(poses, np.ones(50), *MODE_RADIUS)
    np.testing.assert_allclose(mode[:2], weighted_moments(poses, np.ones(50))[0][:2], atol=0.05)
    assert share > 0.9


@pytest.mark.parametrize(("radius", "degrees", "at"), [(1.0, 30.0, 0.3), (0.2, 30.0, 0.6), (1.0, 5.0, 0.6)])
def test_a_mode_is_as_wide_as_is_asked(radius: float, degrees: float, at: float) -> None:
    # Half of the weight is at 0, turned by 10 degrees, and slightly more 0.6 m away.
    poses = np.array([[0.0, 0.0, math.radians(10.0)], [0.6, 0.0, 0.0]])
    mode, _, share, _ = mode_and_mean(poses, np.array([0.4999, 0.5001]), radius, math.radians(degrees))
    assert mode[0] == pytest.approx(at, abs=1e-3)
    assert share == pytest.approx(1.0 if at == 0.3 else 0.5001)
