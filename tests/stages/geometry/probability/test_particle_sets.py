import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from omninav.stages.geometry.plane.se2 import between, compose, wrap
from omninav.stages.geometry.probability.particles import (
    are_within,
    effective_size,
    mode_and_mean,
    occupied_cells,
    share_within,
    systematic,
    uniform_around,
    weighted_mean,
)
from omninav.stages.sensor import nearest_cells
from omninav.stages.sensor.nearest_cells import NearestCells

POSES = st.tuples(*[st.floats(-50, 50)] * 3)


@given(POSES, POSES)
def test_the_motion_between_two_poses_leads_from_one_to_the_other(
    start: tuple[float, ...], end: tuple[float, ...]
) -> None:
    reached = compose(start, between(start, end))
    assert np.allclose(reached[:2], end[:2], atol=1e-9)
    assert abs(float(wrap(reached[2] - end[2]))) < 1e-9


@given(POSES, POSES, POSES)
def test_motions_compose_in_any_grouping(a: tuple[float, ...], b: tuple[float, ...], c: tuple[float, ...]) -> None:
    one, other = compose(compose(a, b), c), compose(a, compose(b, c))
    assert np.allclose(one[:2], other[:2], atol=1e-8)
    assert abs(float(wrap(one[2] - other[2]))) < 1e-9


@settings(deadline=None)  # the first call compiles
@given(st.lists(st.floats(0, 1), min_size=1, max_size=60), st.floats(0, 1, exclude_max=True), st.integers(1, 200))
def test_each_particle_is_drawn_floor_or_ceil_of_its_share(weights: list[float], offset: float, number: int) -> None:
    w = np.array(weights)
    if w.sum() < 1e-3:
        return
    drawn = np.bincount(systematic(w, number, offset), minlength=len(w))
    share = number * w / w.sum()
    assert drawn.sum() == number
    assert (drawn >= np.floor(share - 1e-6)).all()
    assert (drawn <= np.ceil(share + 1e-6)).all()


def test_resampling_is_unbiased_over_the_comb_s_place() -> None:
    weights = np.array([0.02, 0.5, 0.0, 0.13, 0.35])
    counts = [np.bincount(systematic(weights, 7, (i + 0.5) / 1000), minlength=5) for i in range(1000)]
    assert np.allclose(np.mean(counts, axis=0), 7 * weights, atol=2e-3)


def test_the_effective_size_is_that_of_equal_weights_and_of_one_weight() -> None:
    assert effective_size(np.full(40, 0.1)) == pytest.approx(40)
    assert effective_size(np.eye(1, 40)[0]) == pytest.approx(1)


def test_occupied_cells_are_counted_around_the_circle() -> None:
    poses = np.array([[0.1, 0.1, 0.01], [0.2, 0.2, 2 * np.pi + 0.02], [0.1, 0.1, 3.0], [-0.1, 0.1, 0.01]])
    assert occupied_cells(poses, 0.5, np.pi / 6) == 3


def test_the_uniform_belief_covers_the_area_around_the_centres_evenly() -> None:
    centres = np.array([[0.0, 0.0], [0.3, 0.0], [10.0, 5.0]])  # two overlap: their common area must not count twice
    poses = uniform_around(centres, 1.0, 20000, np.random.default_rng(0))
    gap = np.hypot(*(poses[:, None, :2] - centres).transpose(2, 0, 1))
    assert gap.min(axis=1).max() <= 1.0
    # Area of the union of two unit circles 0.3 apart: 2 pi - (2 acos(0.15) - 0.15 sqrt(4 - 0.09)).
    pair = 2 * np.pi - (2 * np.arccos(0.15) - 0.15 * np.sqrt(4 - 0.09))
    assert (gap[:, 2] < 1.0).mean() == pytest.approx(np.pi / (np.pi + pair), abs=0.015)
    assert abs(np.exp(1j * poses[:, 2]).mean()) < 0.02


@given(st.integers(0, 10_000), st.floats(0.2, 2.0))
def test_a_cell_lists_the_points_nearest_to_its_centre(seed: int, radius: float) -> None:
    rng = np.random.default_rng(seed)
    points, places = rng.uniform(0, 5, (30, 2)), rng.uniform(-1, 6, (20, 2))
    cells = NearestCells(points, 3, radius / 4, radius)
    for place, near in zip(places, cells.of(places), strict=True):
        centre = cells.origin + (np.floor((place - cells.origin) / cells.cell) + 0.5) * cells.cell
        gaps = np.hypot(*(points - centre).T)
        wanted = [n for n in np.argsort(gaps)[:3] if gaps[n] < radius]
        if np.hypot(*(points - place).T).min() < radius - cells.cell:
            assert [n for n in near if n >= 0] == wanted
        else:  # it may lie outside of all cells
            assert set(near) - {-1} <= set(wanted)


def test_points_far_apart_take_no_memory_between_them() -> None:
    cells = NearestCells(np.array([[0.0, 0.0], [500.0, 500.0]]), 1, 0.1, 1.0)
    assert cells.of(np.array([[0.0, 0.0], [250.0, 250.0], [500.0, 500.0]])).tolist() == [[0], [-1], [1]]


def test_poses_within_a_tolerance_are_those_of_the_definition_whatever_turns_their_headings_hold():
    rng = np.random.default_rng(2)
    poses = rng.normal(0.0, [0.5, 0.5, 5.0], (4000, 3))
    pose = np.array([0.1, -0.2, 3.0])
    away = poses - pose
    near = (np.square(away[:, :2]).sum(axis=1) <= 0.6**2) & (np.abs(wrap(away[:, 2])) <= 0.7)
    assert 0 < near.sum() < len(near)
    assert are_within(poses, pose, 0.6, 0.7).tolist() == near.tolist()
    assert share_within(poses, np.full(4000, 0.5), pose, 0.6, 0.7) == 0.5 * near.sum()


def test_the_mean_of_all_stands_beside_the_heaviest_mode():
    rng = np.random.default_rng(3)
    poses, weights = rng.normal(0.0, [3.0, 3.0, 2.0], (500, 3)), rng.random(500)
    *_, mean = mode_and_mean(poses, weights, 1.0, 0.5)
    assert mean.tolist() == weighted_mean(poses, weights).tolist()


@pytest.mark.parametrize("seed", range(3))
def test_few_points_are_searched_without_the_tree_and_give_what_it_gives(seed: int, monkeypatch) -> None:
    rng = np.random.default_rng(seed)
    points = np.concatenate([rng.uniform(0, 10, (150, 2)), rng.integers(0, 10, (60, 2)).astype(float)])
    points = np.concatenate([points, points[:40]])  # of those that lie at one place, and on a lattice, the tree chooses
    places = rng.uniform(-2, 12, (3000, 2))
    found = NearestCells(points, 4, 0.25, 1.5).of(places)
    monkeypatch.setattr(nearest_cells, "FEW_POINTS", 0)
    assert found.tolist() == NearestCells(points, 4, 0.25, 1.5).of(places).tolist()
    expected = NearestCells(points[:150], 4, 0.25, 1.5).of(places)
    monkeypatch.undo()
    alone = NearestCells(points[:150], 4, 0.25, 1.5)
    monkeypatch.setattr(alone, "_in_tree", None)
    for some in np.array_split(places, 7):
        alone.of(some)
    assert alone.of(places).tolist() == expected.tolist()
