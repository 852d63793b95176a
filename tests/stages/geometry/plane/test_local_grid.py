import numpy as np
import pytest

from omninav.stages.geometry.plane.local_grid import (
    CELL_M,
    CELLS,
    cell_at,
    frontier,
    marked,
    points_of,
    prices,
    shifted,
    way_to,
    ways_from,
)

AZIMUTHS = -np.pi + np.radians(2.0) * np.arange(180)
NOTHING = np.zeros((CELLS, CELLS))


def test_an_echo_marks_its_cell_and_frees_those_before_it() -> None:
    ranges = np.full(180, np.inf)
    ranges[90 + 45] = 2.0  # to the left of a robot that looks along y: along -x
    grid = marked(NOTHING, np.array([0.05, 0.05, np.pi / 2]), ranges, AZIMUTHS, 4.0)
    assert grid.flat[cell_at(np.array([-1.95, 0.05]))] > 0.0
    assert grid.flat[cell_at(np.array([-1.0, 0.05]))] < 0.0
    assert grid.flat[cell_at(np.array([-2.5, 0.05]))] == 0.0  # behind it
    assert grid.flat[cell_at(np.array([2.5, 0.05]))] < 0.0  # no echo within 4 m
    assert grid.flat[cell_at(np.array([4.5, 0.05]))] == 0.0


def test_a_scan_that_does_not_look_back_says_nothing_of_what_is_there() -> None:
    grid = marked(NOTHING, np.zeros(3), np.full(91, 2.0), AZIMUTHS[45:136], 4.0)  # from -90 to 90 degrees
    assert grid.flat[cell_at(np.array([1.05, 0.05]))] < 0.0
    assert not grid[:, : CELLS // 2 - 1].any()


def test_a_moved_grid_keeps_what_it_holds_where_it_was() -> None:
    grid = NOTHING.copy()
    grid.flat[cell_at(np.array([1.05, 2.05]))] = 1.0
    moved = shifted(grid, 5, -3)
    assert np.argwhere(moved).tolist() == (np.argwhere(grid) - (5, -3)).tolist()
    assert not shifted(grid, -CELLS, 0).any()


def test_the_way_leads_around_a_wall_through_its_gap() -> None:
    grid = np.full((CELLS, CELLS), -1.0)
    wall = cell_at(np.array([1.05, 0.0])) % CELLS
    grid[:, wall] = 1.0
    grid[90:100, wall] = -1.0  # a door, 3.0 to 4.0 m to the left
    cost = prices(grid, 0.2)
    line = way_to(cell_at(np.array([2.05, 0.05])), ways_from(cell_at(np.array([0.05, 0.05])), cost))
    across = line[np.argmin(np.abs(line[:, 0] - 1.05))]
    assert 3.2 < across[1] < 3.8
    assert np.hypot(*np.diff(line, axis=0).T).max() < 1.5 * CELL_M
    assert line[-1] == pytest.approx([2.05, 0.05])


def test_the_frontier_lies_between_what_is_free_and_what_is_unknown() -> None:
    ranges = np.full(180, 1.5)
    ranges[80:101] = np.inf  # an opening ahead, 40 degrees wide
    grid = marked(NOTHING, np.zeros(3), ranges, AZIMUTHS, 4.0)
    ahead = points_of(frontier(grid, prices(grid, 0.2)))
    assert len(ahead)
    assert (ahead[:, 0] > 1.2).all()
    assert (np.abs(ahead[:, 1]) < 1.6).all()
