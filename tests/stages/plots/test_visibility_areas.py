import numpy as np
import pytest
from measured_drives import made_drive, on_x
from small_run import small_run

from omninav.pipeline import Context
from omninav.stages.plots.trajectory_over_map import TrajectoryOverMap
from omninav.stages.plots.visibility_areas import ShowVisibilityAreas, views_by_cell
from omninav.stages.sensor.line_of_sight import axes_of, visibility_areas
from omninav.stages.values.grid import FREE, OCCUPIED, OccupancyGrid
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.thumbnails import decoded

CTX = Context("view")


def a_room() -> OccupancyGrid:
    cells = np.full((20, 30), FREE, np.uint8)
    cells[[0, -1], :] = cells[:, [0, -1]] = cells[8:10, 10:20] = OCCUPIED
    return OccupancyGrid(cells, 0.2, (0.0, 0.0))


ROOM = a_room()
POSES = np.array([[1.0, 1.0, 0.3], [3.0, 1.0, 1.6], [5.0, 3.0, 3.0], [1.5, 3.3, -1.0]])
MAP = ReferenceGraph(POSES, np.zeros((4, 3, 1), np.float32), "histograms", np.zeros((0, 2), np.int64), "truth")


def test_views_are_counted_cell_by_cell():
    areas = visibility_areas(POSES, ROOM, axes_of(3))
    counts = sum(areas.mask(target).astype(int) for target in areas.target.ravel() if target >= 0)
    np.testing.assert_array_equal(views_by_cell(areas), counts)


def test_areas_are_drawn_over_the_grid_the_same_every_time(monkeypatch: pytest.MonkeyPatch):
    areas = visibility_areas(POSES, ROOM, axes_of(3))
    driven = made_drive(on_x((1.0 + 0.1 * k for k in range(10)), 1.0))
    monkeypatch.setattr("omninav.stages.plots.visibility_areas.EXAMPLES", 2)
    plot = ShowVisibilityAreas().step(CTX, MAP, areas, ROOM, driven).plot
    assert decoded(plot.content).std() > 20
    assert "2 of 4 references" in plot.caption
    assert "3 points lambda" in plot.caption
    again = ShowVisibilityAreas().step(CTX, MAP, areas, ROOM, driven).plot
    assert again.content == plot.content
    without = ShowVisibilityAreas().step(CTX, MAP, areas, ROOM).plot
    assert without.content != plot.content


def test_a_stand_in_is_called_one(monkeypatch: pytest.MonkeyPatch):
    areas = visibility_areas(POSES, ROOM, axes_of(1))
    grid = OccupancyGrid(ROOM.cells, ROOM.resolution, ROOM.origin, "tour")
    monkeypatch.setattr("omninav.stages.plots.visibility_areas.EXAMPLES", 1)
    assert "stand-in" in ShowVisibilityAreas().step(CTX, MAP, areas, grid).plot.caption


def test_a_grid_lies_under_paths_where_it_is_wired():
    run = small_run()
    paths = [TrajectoryOverMap().step(CTX, run.drive, run.map, grid).plot for grid in (None, ROOM)]
    assert paths[0].content != paths[1].content
