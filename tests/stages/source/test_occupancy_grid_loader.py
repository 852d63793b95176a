"""Free space in a grid, and stand-ins for a grid that follow a tour's path."""

import numpy as np
import pytest
from landmark_tour import graph_of

from omninav.pipeline import BadInput, Context
from omninav.stages.source.occupancy_grid_loader import OccupancyGridLoader, along_path, free_space
from omninav.stages.values.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from omninav.stages.values.length_scale import LengthScale


def states_at(grid: OccupancyGrid, points: np.ndarray) -> np.ndarray:
    return grid.cells[tuple(grid.cells_of(points).T)]


def test_free_space_keeps_clear_of_obstacles_and_is_what_is_connected_to_the_references():
    cells = np.full((7, 15), FREE, np.uint8)
    cells[:, 7] = OCCUPIED
    grid = OccupancyGrid(cells, 0.1, (0.0, 0.0))
    assert len(free_space(grid, 0.0, None).centres) == 14 * 7
    assert len(free_space(grid, 0.0, np.array([[0.25, 0.25]])).centres) == 7 * 7
    # 0.25 m from the wall, whose face lies at x = 0.7: the centres 0.05 to 0.45
    kept = free_space(grid, 0.25, np.array([[0.25, 0.25]])).centres
    assert kept[:, 0].max() == pytest.approx(0.45)
    assert free_space(grid, 5.0, None) is None
    assert len(free_space(grid, 0.0, np.array([[0.0, 0.0], [1.45, 0.65], [1.55, 0.65], [0.0, 0.75]])).centres) == 14 * 7
    assert free_space(grid, 0.0, np.array([[9.0, 9.0], [-0.05, 0.0], [0.0, -0.05], [0.75, 0.0]])) is None


def test_a_stand_in_is_free_along_the_tours_path_and_walled_around_it():
    ctx = Context("grid")
    stage = OccupancyGridLoader(grid="from_tour", log="drive.mcap", resolution_m=0.1)
    out = stage.step(
        ctx, None, graph_of(np.array([(0.0, 0.0, 0.0), (4.0, 0.0, 0.0), (4.0, 3.0, 0.0)])), LengthScale(0.25)
    )
    assert out.grid.made_from == "tour"
    assert ctx.counts["grid_is_a_stand_in"] == 1
    assert "stand-in" in ctx.facts["grid"]
    # free to 2 reaches = 0.5 m from the path, a cell of wall behind, unknown beyond
    found = states_at(out.grid, np.array([[2.0, 0.0], [2.0, 0.4], [2.0, 0.55], [2.0, 0.8], [3.6, 2.0], [-0.55, 0.0]]))
    assert found.tolist() == [FREE, FREE, OCCUPIED, UNKNOWN, FREE, OCCUPIED]
    # two straight pieces of 4 and 3 m, 1 m wide, and round ends: 7 + pi / 4, less half the corner they share
    assert len(out.free.centres) * 0.01 == pytest.approx(7 + np.pi / 4 - 0.25, abs=0.25)
    assert stage.inputs_digest() is None


def test_a_stand_in_without_edges_is_free_around_the_references_alone():
    poses = np.array([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0]])
    grid = along_path(poses, np.zeros((0, 2), np.int64), 0.5, 0.1)
    assert states_at(grid, np.array([[2.0, 0.0], [4.3, 0.0]])).tolist() == [UNKNOWN, FREE]
    # the margin is 0.5 m and two cells on all sides; cells whose centres lie within five cells of a place are free
    wide = along_path(poses, np.array([[0, 1]]), 0.51, 0.1)
    assert (grid.cells.shape, grid.origin) == ((14, 54), pytest.approx((-0.7, -0.7)))
    assert ((grid.cells == FREE).sum(), (wide.cells[:, 27] == FREE).sum()) == (2 * 80, 10)


def test_a_stand_in_without_a_map_is_refused():
    with pytest.raises(BadInput, match="from_tour needs a map"):
        OccupancyGridLoader(grid="from_tour").step(Context("grid"))
