import numpy as np
import pytest

from omninav.stages.control.local_grid import (
    CELL_M,
    CELLS,
    cell_at,
    frontier,
    marked,
    on_grid,
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
    ranges[90 + 45] = 2.03  # to the left of a robot that looks along y: along -x
    grid = marked(NOTHING, np.array([0.05, 0.05, np.pi / 2]), ranges, AZIMUTHS, 4.0)
    # Within 0.1 m of the echo, before and behind it; and along another beam, without an echo within 4 m.
    cells = [cell_at(np.array([x, 0.05])) for x in (-1.95, -2.05, -1.85, -2.15, 2.5, 4.5)]
    assert grid.flat[cells].tolist() == [0.8, 0.8, -0.4, 0.0, -0.4, 0.0]


def test_wide_beams_tell_less_and_no_cell_is_told_without_end() -> None:
    ranges, azimuths, at = np.full(18, 2.0), AZIMUTHS[::10], cell_at(np.array([2.05, 0.05]))
    grid = marked(NOTHING, np.zeros(3), ranges, azimuths, 4.0)
    assert grid.flat[at] == pytest.approx(0.8 * 0.2 / (np.hypot(2.05, 0.05) * np.radians(20.0)))
    for _ in range(20):
        grid = marked(grid, np.zeros(3), ranges, azimuths, 4.0)
    assert (grid.max(), grid.min()) == (3.0, -3.0)


def test_a_scan_that_does_not_look_back_says_nothing_of_what_is_there() -> None:
    grid = marked(NOTHING, np.zeros(3), np.full(91, 2.0), AZIMUTHS[45:136], 4.0)  # from -90 to 90 degrees
    assert grid.flat[cell_at(np.array([1.05, 0.05]))] < 0.0
    assert not grid[:, : CELLS // 2 - 1].any()


def test_a_scan_that_ends_where_it_began_is_taken_as_one_turn() -> None:
    ranges, degree = np.full(361, np.inf), np.radians(1.0)
    ranges[260:281] = 2.0  # to the left: the azimuths begin behind the robot
    grid = marked(NOTHING, np.zeros(3), ranges, -np.pi + degree * np.arange(361), 4.0)
    assert grid.flat[cell_at(np.array([0.05, 1.95]))] > 0.0
    turned = marked(NOTHING, np.zeros(3), ranges[:-1], -np.pi + degree * np.arange(360), 4.0)
    np.testing.assert_array_equal(grid, turned)


def test_a_scan_that_turns_clockwise_tells_the_same() -> None:
    ranges = np.linspace(1.0, 3.0, 91)
    one = marked(NOTHING, np.zeros(3), ranges, AZIMUTHS[45:136], 4.0)
    other = marked(NOTHING, np.zeros(3), ranges[::-1], AZIMUTHS[45:136][::-1], 4.0)
    middles = points_of(np.arange(CELLS * CELLS))
    tied = np.abs(np.degrees(np.arctan2(*middles.T[::-1])) % 2.0 - 1.0) < 1e-6  # between two beams
    np.testing.assert_allclose(one.ravel()[~tied], other.ravel()[~tied])


def test_what_echoes_and_free_beams_leave_undecided_is_known_all_the_same() -> None:
    at = cell_at(np.array([0.95, 0.05]))
    near, far = np.full(180, 1.0), np.full(180, 2.0)
    grid = NOTHING
    for ranges in (near, far, far):
        grid = marked(grid, np.zeros(3), ranges, AZIMUTHS, 4.0)
    assert grid.flat[at] == pytest.approx(0.0, abs=1e-6)
    assert grid.flat[at] != 0.0


def test_points_lie_on_the_grid_up_to_its_edges() -> None:
    edge = CELL_M * CELLS / 2
    assert on_grid(np.array([[0.0, edge - 0.01], [edge + 0.01, 0.0], [0.0, -edge - 0.01]])).tolist() == [1, 0, 0]
    assert [cell_at(np.full(2, at)) for at in (-edge - 9.0, edge + 9.0)] == [0, CELLS * CELLS - 1]


def test_a_moved_grid_keeps_what_it_holds_where_it_was() -> None:
    grid = NOTHING.copy()
    grid.flat[cell_at(np.array([1.05, 2.05]))] = 1.0
    moved = shifted(grid, 5, -3)
    assert np.argwhere(moved).tolist() == (np.argwhere(grid) - (5, -3)).tolist()
    for far in (CELLS, CELLS + 1, 2 * CELLS - 1, 3 * CELLS):
        assert not shifted(grid, -far, far).any()


def test_the_way_leads_around_a_wall_through_its_gap() -> None:
    grid = np.full((CELLS, CELLS), -1.0)
    wall = cell_at(np.array([1.05, 0.0])) % CELLS
    grid[:, wall] = 1.0
    grid[90:100, wall] = -1.0  # a door, 3.0 to 4.0 m to the left
    cost = prices(grid, 0.2)
    assert prices(grid, 0.21)[0, wall : wall + 5].tolist() == [20.0, 20.0, 20.0, 3.0, 1.0]
    assert (prices(NOTHING, 0.2) == 1.5).all()  # nothing is known
    line = way_to(cell_at(np.array([2.05, 0.05])), ways_from(cell_at(np.array([0.05, 0.05])), cost))
    across = line[np.argmin(np.abs(line[:, 0] - 1.05))]
    assert 3.2 < across[1] < 3.8
    assert np.hypot(*np.diff(line, axis=0).T).max() < 1.5 * CELL_M
    assert line[-1] == pytest.approx([2.05, 0.05])


def test_a_metre_costs_the_mean_of_both_cells_and_diagonals_are_longer() -> None:
    cost, start = np.ones((CELLS, CELLS)), cell_at(np.zeros(2))
    cost.flat[start + 1] = 3.0
    price = ways_from(start, cost).price[[start + 1, start - 1, start + 2 * CELLS - 3, start - 2 * CELLS - 3]]
    assert price == pytest.approx([0.2, 0.1, *[0.1 + 0.2 * 2.0**0.5] * 2])


def test_the_frontier_is_free_with_room_and_beside_what_is_unknown() -> None:
    grid, cell = np.full((CELLS, CELLS), -1.0), cell_at(np.zeros(2))
    grid.flat[[cell, cell - 3]] = 0.0, 1.0  # the obstacle leaves no room in the one cell 0.2 m from it
    around = [cell + row * CELLS + column for row in (-1, 0, 1) for column in (-1, 0, 1) if column > 0 or row]
    assert frontier(grid, prices(grid, 0.21)).tolist() == around
