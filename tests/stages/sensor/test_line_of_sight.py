"""Visibility areas, against hand-drawn rooms and against geometry worked cell by cell."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_references import references
from scipy import ndimage

from omninav.pipeline import Context
from omninav.pipeline.graph.problems import BadInput
from omninav.stages.sensor.line_of_sight import (
    LineOfSight,
    axes_of,
    covered,
    first_occupied,
    grow_areas,
    visibility_areas,
)
from omninav.stages.values.grid import FREE, OCCUPIED, UNKNOWN, FreeSpace, OccupancyGrid
from omninav.stages.values.maps import ReferenceGraph

STATES = {".": FREE, "#": OCCUPIED, "?": UNKNOWN}


def drawn(*rows: str, resolution: float = 1.0) -> OccupancyGrid:
    """A grid as it is drawn: the last line lies at the lowest y."""
    cells = np.array([[STATES[sign] for sign in row] for row in reversed(rows)], np.uint8)
    return OccupancyGrid(cells, resolution, (0.0, 0.0))


def a_map(*poses: tuple[float, float, float], segments: int = 1) -> ReferenceGraph:
    return references(poses, np.zeros((len(poses), segments, 4), np.float32))


ROOM = drawn(
    "#########",
    "#.......#",
    "#.......#",
    "#..###..#",
    "#.......#",
    "#.......#",
    "#########",
)


AREAS = visibility_areas(np.array([[4.5, 1.5, math.pi / 2]]), ROOM, axes_of(1))


def test_a_view_sees_the_face_of_the_closest_occupied_cell_ahead_of_it():
    cells, faces = first_occupied(ROOM.cells, np.array([[1.5, 4.5]] * 4), np.radians([90.0, 0.0, -90.0, 180.0]))
    assert cells.tolist() == [[3, 4], [1, 8], [0, 4], [1, 0]]
    # the faces below, to the left, above and to the right of these cells
    assert faces.tolist() == [3, 1, 2, 0]
    assert AREAS.points[0] == pytest.approx([4.5, 3.0], abs=0.01)


def test_views_to_all_four_sides_see_the_faces_there_wherever_the_grid_lies():
    grid = OccupancyGrid(ROOM.cells, 1.0, (10.0, -20.0))
    areas = visibility_areas(np.array([[14.5, -18.5, math.pi / 4]]), grid, axes_of(4))
    faces = np.array([[11.0, -18.5], [14.5, -17.0], [18.0, -18.5], [14.5, -19.0]])
    assert areas.points[areas.target[0]] == pytest.approx(faces, abs=0.01)


def test_what_is_unknown_or_outside_blocks_and_shows_nothing():
    grid = drawn("..?#", "....", "...#")
    cells, _ = first_occupied(
        grid.cells, np.array([[2.5, 0.5], [1.5, 0.5], [0.5, 0.5], [2.5, 3.5], [9.5, 0.5]]), np.zeros(5)
    )
    assert cells.tolist() == [[-1, -1], [-1, -1], [0, 3], [-1, -1], [-1, -1]]


def test_an_area_is_what_sees_its_point_and_not_the_other_side_of_a_thin_wall():
    # The point lies below the middle of the block. From above it nothing is seen; to its sides one looks past it only
    # from what lies below the block's lower face, y = 3.
    mask = AREAS.mask(0)
    assert mask[1:3, 1:8].all()
    assert mask.sum() == 14


def test_a_door_lets_through_a_cone_of_view():
    # The point is on the wall at x = 8, y = 2.5; through the door at (4, 2) one sees it from the row at y = 2.5 alone.
    grid = drawn(
        "#########",
        "#...#...#",
        "#.......#",
        "#...#...#",
        "#########",
    )
    areas = visibility_areas(np.array([[6.5, 2.5, 0.0]]), grid, axes_of(1))
    assert areas.points[0] == pytest.approx([8.0, 2.5], abs=0.01)
    mask = areas.mask(0)
    assert mask[1:4, 5:8].all()
    # from (3.5, 1.5) the line rises by 1 over 4.5: at x = 4 it is at 1.61, below the door's sill y = 2
    assert mask[:, 1:4].sum() == 3
    assert mask[2].sum() == 7


def crosses(start: np.ndarray, end: np.ndarray, row: int, column: int) -> bool:
    """Whether a line runs through the inside of a cell (Liang & Barsky's clipping)."""
    low, high = 0.0, 1.0
    for at, to, edge in ((start[0], end[0], row), (start[1], end[1], column)):
        step = to - at
        if abs(step) < 1e-12:
            if not edge < at < edge + 1:
                return False
            continue
        one, other = sorted(((edge - at) / step, (edge + 1 - at) / step))
        low, high = max(low, one), min(high, other)
    return high - low > 1e-9


def by_clipping(cells: np.ndarray, point: np.ndarray) -> np.ndarray:
    blocking = np.argwhere(cells != FREE)
    sees = np.zeros(cells.shape, bool)
    for row, column in np.argwhere(cells == FREE):
        middle = np.array([row + 0.5, column + 0.5])
        sees[row, column] = not any(crosses(middle, point, *cell) for cell in blocking)
    labels, _ = ndimage.label(sees, np.ones((3, 3)))
    return labels == labels[int(point[0]), int(point[1])]


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_areas_are_those_of_clipping_every_line_at_every_cell(seed: int):
    rng = np.random.default_rng(seed)
    cells = rng.choice([FREE, OCCUPIED, UNKNOWN], (9, 11), p=[0.8, 0.15, 0.05]).astype(np.uint8)
    points = []
    for row, column in np.argwhere(cells == OCCUPIED):
        for step in ((0, 1), (0, -1), (1, 0), (-1, 0)):
            beside = row + step[0], column + step[1]
            if 0 <= beside[0] < 9 and 0 <= beside[1] < 11 and cells[beside] == FREE:
                points.append((row + 0.5 + 0.501 * step[0], column + 0.5 + 0.501 * step[1]))
    if not points:
        return
    runs, starts = grow_areas(cells, np.array(points))
    for number, point in enumerate(points[:6]):
        mask = np.zeros(cells.shape, bool)
        for row, first, behind in runs[starts[number] : starts[number + 1]]:
            mask[row, first:behind] = True
        np.testing.assert_array_equal(mask, by_clipping(cells, np.array(point)))


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_a_ray_meets_the_cell_that_clipping_meets_first(seed: int):
    rng = np.random.default_rng(seed)
    cells = rng.choice([FREE, OCCUPIED, UNKNOWN], (9, 11), p=[0.85, 0.1, 0.05]).astype(np.uint8)
    start, direction = rng.uniform(0, (9, 11)), rng.uniform(-np.pi, np.pi)
    found, _ = first_occupied(cells, start[None], np.array([direction]))
    way = np.array([np.sin(direction), np.cos(direction)])
    # In the middle between two lines of the grid that follow each other on the way, the ray is inside a cell.
    crossed = np.sort(np.concatenate([(np.arange(12) - at) / step for at, step in zip(start, way, strict=True)]))
    crossed = np.concatenate([[0.0], crossed[(crossed > 0) & (crossed < 15)], [15.0]])
    along = np.floor(start + ((crossed[1:] + crossed[:-1]) / 2)[:, None] * way).astype(int)
    inside = ((along >= 0) & (along < cells.shape)).all(axis=1)
    along = along[: int(np.argmin(inside)) if not inside.all() else None]
    states = cells[along[:, 0], along[:, 1]]
    first = int(np.argmax(states != FREE)) if (states != FREE).any() else None
    met = first is not None and first > 0 and states[first] == OCCUPIED
    assert found[0].tolist() == (along[first].tolist() if met else [-1, -1])


def test_sectors_look_along_the_middles_of_a_panoramas_parts():
    assert axes_of(1) == pytest.approx([0.0])
    # clockwise from straight behind: the first of four parts covers 180 to 90 degrees
    assert np.degrees(axes_of(4)) == pytest.approx([135.0, 45.0, -45.0, -135.0])
    out = LineOfSight().step(Context("areas"), a_map((4.5, 1.5, 0.0), segments=4), ROOM)
    assert out.areas.target.shape == (1, 4)
    for sector, axis in enumerate(axes_of(4)):
        point = out.areas.points[out.areas.target[0, sector]]
        aside = (point[1] - 1.5) * math.cos(axis) - (point[0] - 4.5) * math.sin(axis)
        assert abs(aside) < 0.501  # the ray meets the face, whose middle is half a cell away at most


def test_views_that_meet_the_same_face_share_an_area():
    areas = visibility_areas(np.array([[4.5, 1.5, math.pi / 2], [4.4, 1.2, math.pi / 2]]), ROOM, axes_of(1))
    assert areas.target.tolist() == [[0], [0]]
    assert len(areas.points) == 1


def test_the_share_of_places_and_of_headings_that_areas_cover():
    centres = ROOM.centres(*np.nonzero(ROOM.cells == FREE))
    place, state = covered(AREAS, centres, math.radians(5.0))
    assert place == pytest.approx(14 / 32)
    assert state == pytest.approx(14 / 32 * 11 / 360)  # 11 whole degrees of 360, 5 to each side of one
    assert covered(AREAS, centres, math.pi) == (place, place)


def test_it_says_what_it_covers_and_how_much_it_takes():
    ctx = Context("areas")
    free = FreeSpace(ROOM.centres(np.array([1, 1]), np.array([1, 2])), 1.0)
    out = LineOfSight().step(ctx, a_map((4.5, 1.5, math.pi / 2), (-3.0, 1.5, 0.0)), ROOM, free)
    expected = {
        "references": 2, "areas": 1, "covered_rate": 1.0, "area_median_m2": 14.0, "size_bytes": out.areas.nbytes
    }  # fmt: skip
    assert expected.items() <= out.metrics.values["visibility"].items()
    assert ctx.counts["view_without_area"] == 1


@pytest.mark.parametrize(
    ("source", "made_from", "warned"), [("odometry", "map", 1), ("odometry", "tour", 0), ("truth", "map", 0)]
)
def test_a_map_of_odometry_on_a_grid_of_another_frame_is_warned_of(source, made_from, warned):
    ctx, seen = Context("areas"), references([(4.5, 1.5, 0.0)], np.zeros((1, 1, 4), np.float32), source=source)
    LineOfSight().step(ctx, seen, replace(ROOM, made_from=made_from))
    assert len(ctx.warnings) == warned


def test_a_map_that_lies_beside_its_grid_is_refused():
    with pytest.raises(BadInput, match="same frame"):
        LineOfSight().step(Context("areas"), a_map((-4.5, 1.5, 0.0)), ROOM)
