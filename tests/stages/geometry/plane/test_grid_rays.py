"""Cells along rays, against points sampled densely along them."""

import math

import numba
import numpy as np
import pytest

from omninav.stages.geometry.plane.grid_rays import cells_along


@numba.njit
def first_cells(row: float, column: float, down: float, across: float, number: int) -> np.ndarray:
    out = np.empty((number, 4))
    for k, (i, j, sideways, entered) in enumerate(cells_along(row, column, down, across)):
        out[k, 0], out[k, 1], out[k, 2], out[k, 3] = i, j, sideways, entered
        if k + 1 == number:
            break
    return out


@pytest.mark.parametrize("seed", range(20))
def test_a_ray_enters_the_cells_of_its_points_in_order(seed: int) -> None:
    rng = np.random.default_rng(seed)
    start, angle = rng.uniform(-5, 5, 2), rng.uniform(-math.pi, math.pi)
    direction = np.array([math.sin(angle), math.cos(angle)])
    found = first_cells(*start, *direction, 30)
    points = start + np.linspace(0.0, found[-1, 3] + 1e-9, 400_000)[:, None] * direction
    cells = np.floor(points)
    entered = cells[1:][(np.diff(cells, axis=0) != 0).any(axis=1)]
    np.testing.assert_array_equal(found[:, :2], entered)


def test_distances_are_in_lengths_of_the_direction_and_edges_are_told_apart() -> None:
    found = first_cells(0.5, 0.25, 0.0, 2.0, 3)
    assert found[:, :2].tolist() == [[0, 1], [0, 2], [0, 3]]
    assert found[:, 2].all()
    assert found[:, 3] == pytest.approx([0.375, 0.875, 1.375])
    backwards = first_cells(0.5, 0.25, -1.0, 0.0, 2)
    assert backwards.tolist() == [[-1, 0, 0, 0.5], [-2, 0, 0, 1.5]]


def test_through_a_corner_the_row_changes_first() -> None:
    assert first_cells(0.5, 0.5, 1.0, 1.0, 2)[:, :2].tolist() == [[1, 0], [1, 1]]
