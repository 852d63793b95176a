"""Rooms, grids, free space, visibility areas and scans: what is where on the floor."""

import numpy as np
import pytest

from omninav.stages.values.grid import FreeSpace, OccupancyGrid
from omninav.stages.values.homing_field import HomingField
from omninav.stages.values.rooms import Rooms
from omninav.stages.values.scan import Scan
from omninav.stages.values.visibility import VisibilityAreas


def test_a_point_is_in_the_smallest_room_around_it_edges_included() -> None:
    corners = [[0.0, 0.0, 10.0, 4.0], [2.0, 1.0, 4.0, 3.5], [2.0, 1.0, 9.0, 2.0], [20.0, 20.0, 21.0, 21.0]]
    rooms = Rooms(("hall", "shop", "aisle", "yard"), np.array(corners))
    points = [(1.0, 2.0), (3.0, 1.5), (5.0, 1.5), (2.0, 3.5), (4.0, 3.0), (9.0, 2.0), (10.0, 4.0), (0.0, 0.0)]
    assert [rooms.at(*point) for point in points] == ["hall", "shop", "aisle", "shop", "shop", "aisle", "hall", "hall"]
    assert [rooms.at(*point) for point in [(-0.1, 2.0), (10.1, 2.0), (5.0, -0.1), (5.0, 4.1)]] == [""] * 4


def test_cells_and_their_centres_are_counted_from_the_lower_left_corner() -> None:
    grid = OccupancyGrid(np.zeros((4, 6), np.uint8), 0.5, (-1.0, 2.0))
    assert grid.cells_of(np.array([[-1.0, 2.0, 9.0], [0.1, 3.9, 9.0], [-1.1, 1.9, 9.0]])).tolist() == [
        [0, 0],
        [3, 2],
        [-1, -1],
    ]
    assert grid.centres(np.array([0, 3]), np.array([0, 2])).tolist() == [[-0.75, 2.25], [0.25, 3.75]]


def test_poses_are_drawn_all_over_the_cells_and_headings() -> None:
    space = FreeSpace(np.array([[1.0, 5.0], [3.0, 8.0]]), 0.5)
    poses = space.draw(np.random.default_rng(0), 4000)
    first = poses[:, 0] < 2.0
    assert first.mean() == pytest.approx(0.5, abs=0.05)
    for cell, centre in ((first, [1.0, 5.0, 0.0]), (~first, [3.0, 8.0, 0.0])):
        off = poses[cell] - centre
        reach = [0.25, 0.25, np.pi]
        assert off.min(axis=0) == pytest.approx(np.negative(reach), abs=0.02)
        assert off.max(axis=0) == pytest.approx(reach, abs=0.02)
        assert off.mean(axis=0) == pytest.approx(np.zeros(3), abs=0.15)


def test_a_point_is_seen_from_the_runs_of_its_own_area() -> None:
    runs = np.array([[0, 1, 3], [2, 0, 1], [1, 2, 4]], np.uint16)
    areas = VisibilityAreas(
        np.zeros(1),
        np.zeros((1, 1), np.int32),
        np.zeros((2, 2)),
        np.array([0, 2, 3], np.int32),
        runs,
        (3, 4),
        1.0,
        (0, 0),
    )
    assert np.argwhere(areas.mask(0)).tolist() == [[0, 1], [0, 2], [2, 0]]
    assert np.argwhere(areas.mask(1)).tolist() == [[1, 2], [1, 3]]
    assert areas.nbytes == 8 + 4 + 32 + 12 + 18


def test_readings_and_homing_vectors_say_where_they_point_and_from_how_far() -> None:
    assert Scan(np.ones(3), -0.5, 0.25, 0.1, 9.0).azimuths().tolist() == [-0.5, -0.25, 0.0]
    poses = np.array([[4.0, 6.0, 9.0], [1.0, 2.0, 9.0], [-5.0, 10.0, 9.0]])
    field = HomingField(np.array([1.0, 2.0, 0.0]), poses, np.zeros(3), np.zeros(3), np.zeros(3, np.int64))
    assert field.metres.tolist() == [5.0, 0.0, 10.0]
