"""Computes the visibility areas of a map's references over an occupancy grid."""

import math

import numpy as np
import numpy.typing as npt

from omninav.pipeline import BadInput, Context, Metrics, Outputs, Stage
from omninav.pipeline.engine.compiled import compiled
from omninav.stages.geometry.arrays import Array, Bools, Ints, Shorts
from omninav.stages.geometry.plane.grid_rays import cells_along
from omninav.stages.values.grid import FREE, OCCUPIED, Cells, FreeSpace, OccupancyGrid
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import OWN_FRAMES, SOURCE_WORDS
from omninav.stages.values.visibility import VisibilityAreas

Runs = npt.NDArray[np.uint16]

MAX_CELLS_PER_SIDE = 65535
"""Rows and columns are stored in 16 bits."""
FACE_GAP_CELLS = 1e-3
"""Distance between the face of an occupied cell and the point that must be visible."""
FACES = np.array(
    [
        [0.0, 0.5 + FACE_GAP_CELLS],
        [0.0, -0.5 - FACE_GAP_CELLS],
        [0.5 + FACE_GAP_CELLS, 0.0],
        [-0.5 - FACE_GAP_CELLS, 0.0],
    ]
)
"""From an occupied cell's centre to the point in front of a face: rows, columns; right, left, upper, lower face."""
HEADING_BINS = 360
"""Headings distinguished where the covered share of the state space is counted."""
WITHIN_DEG = 5.0
"""Deviation of a forward-looking camera's heading from lambda in the reported coverage of the state space, degrees;
the coverage is counted over `free` where wired, else over all free cells."""


def axes_of(sectors: int) -> Array:
    """Azimuths (rad) of the middles of a panorama's equal parts; one part looks straight ahead. (sectors,)."""
    return np.pi - 2 * np.pi * (np.arange(sectors) + 0.5) / sectors


@compiled(nogil=True)
def first_occupied(cells: Cells, starts: Array, directions: Array) -> tuple[Ints, Ints]:
    """The closest occupied cell along rays through free cells: (N, 2) row and column, -1 where none; (N,), of `FACES`.

    `starts` (N, 2): row and column in cells, as numbers whose whole part is the cell; `directions` (N,) rad. A ray that
    begins in a cell that is not free, leaves the grid, or enters an unknown cell hits nothing (erratum 46 in
    docs/papers.md).
    """
    found, faces = np.full((len(starts), 2), -1, np.int64), np.full(len(starts), -1, np.int64)
    rows, columns = cells.shape
    for n in range(len(starts)):
        row, column = math.floor(starts[n, 0]), math.floor(starts[n, 1])
        if not (0 <= row < rows and 0 <= column < columns) or cells[row, column] != FREE:
            continue
        down, across = math.sin(directions[n]), math.cos(directions[n])
        for i, j, sideways, _ in cells_along(starts[n, 0], starts[n, 1], down, across):
            if not (0 <= i < rows and 0 <= j < columns):
                break
            if cells[i, j] == OCCUPIED:
                found[n, 0], found[n, 1] = i, j
                faces[n] = (1 if across > 0 else 0) if sideways else (3 if down > 0 else 2)
                break
            if cells[i, j] != FREE:
                break
    return found, faces


@compiled(nogil=True)
def _sees(cells: Cells, row: int, column: int, to_row: float, to_column: float) -> bool:
    # Whether the line from a cell's middle to a point crosses free cells only. The point is in a free cell.
    last_row, last_column = math.floor(to_row), math.floor(to_column)
    steps = abs(last_row - row) + abs(last_column - column)
    if steps == 0:
        return True
    i, j = row, column
    for i, j, _, _ in cells_along(row + 0.5, column + 0.5, to_row - (row + 0.5), to_column - (column + 0.5)):
        steps -= 1
        if cells[i, j] != FREE:
            return False
        if steps == 0:
            break
    return i == last_row and j == last_column


@compiled(nogil=True)
def grow_areas(cells: Cells, points: Array) -> tuple[Runs, Shorts]:
    """Cells from which points are visible, by constrained region growing (Wolf, Burgard & Burkhardt 2005, section V).

    `points` (T, 2): row and column in cells, in free cells. From a point's own cell the area grows over its eight
    neighbours as long as they are free and the line from their middle to the point crosses free cells only. Gives runs
    of rows (N, 3) row, first column, column behind the last, and where each point's begin, (T + 1,).
    """
    rows, columns = cells.shape
    tried = np.full((rows, columns), -1, np.int32)
    seen = np.full((rows, columns), -1, np.int32)
    waiting = np.empty((rows * columns, 2), np.int32)
    runs, number = np.empty((1024, 3), np.uint16), 0
    starts = np.zeros(len(points) + 1, np.int32)
    for t in range(len(points)):
        row, column = math.floor(points[t, 0]), math.floor(points[t, 1])
        tried[row, column] = seen[row, column] = t
        waiting[0] = row, column
        done, end = 0, 1
        low, high, left, right = row, row, column, column
        while done < end:
            row, column = waiting[done]
            done += 1
            for i in range(max(row - 1, 0), min(row + 2, rows)):
                for j in range(max(column - 1, 0), min(column + 2, columns)):
                    if tried[i, j] == t or cells[i, j] != FREE:
                        continue
                    tried[i, j] = t
                    if _sees(cells, i, j, points[t, 0], points[t, 1]):
                        seen[i, j] = t
                        waiting[end] = i, j
                        end += 1
                        low, high, left, right = min(low, i), max(high, i), min(left, j), max(right, j)
        for i in range(low, high + 1):
            j = left
            while j <= right:
                if seen[i, j] != t:
                    j += 1
                    continue
                first = j
                while j <= right and seen[i, j] == t:
                    j += 1
                if number == len(runs):
                    larger = np.empty((2 * number, 3), np.uint16)
                    larger[:number] = runs
                    runs = larger
                runs[number, 0], runs[number, 1], runs[number, 2] = i, first, j
                number += 1
        starts[t + 1] = number
    return runs[:number].copy(), starts


def visibility_areas(poses: Array, grid: OccupancyGrid, axes: Array) -> VisibilityAreas:
    """The visibility areas of views from poses (R, 3) along azimuths (S,) from their headings.

    Where the paper speaks of the closest occupied cell, here the face counts that the view hits: a wall one cell thick
    is not seen from its other side. A point lambda is the middle of such a face; views that hit the same face share
    one point and one area.
    """
    rows, columns = grid.cells.shape
    starts = (poses[:, 1::-1] - grid.origin[::-1]) / grid.resolution
    directions = (poses[:, 2, None] + axes).ravel()
    seen, seen_faces = first_occupied(grid.cells, np.repeat(starts, len(axes), axis=0), directions)
    hit = seen_faces >= 0
    numbers = (seen[hit, 0] * columns + seen[hit, 1]) * len(FACES) + seen_faces[hit]
    faces, which = np.unique(numbers, return_inverse=True)
    target = np.full(len(hit), -1, np.int32)
    target[hit] = which
    cell, face = np.divmod(faces, len(FACES))
    points = np.column_stack(np.divmod(cell, columns)) + 0.5 + FACES[face]
    runs, first = grow_areas(grid.cells, points)
    metres = np.array(grid.origin) + grid.resolution * points[:, ::-1]
    shape = target.reshape(len(poses), len(axes))
    return VisibilityAreas(axes, shape, metres, first, runs, (rows, columns), grid.resolution, grid.origin)


def covered(areas: VisibilityAreas, centres: Array, window: float) -> tuple[float, float]:
    """The share of places (N, 2) in any area, and of places and headings in one whose point is within `window` radians
    of the heading."""
    if not len(centres):
        return 0.0, 0.0
    cells = np.floor((centres[:, ::-1] - areas.origin[::-1]) / areas.resolution).astype(np.int64)
    where = np.full(areas.shape, -1, np.int64)
    where[cells[:, 0], cells[:, 1]] = np.arange(len(centres))
    seen = _headings(areas.starts, areas.runs, areas.points, where, centres, window)
    return float(seen.any(axis=1).mean()), float(seen.mean())


@compiled(nogil=True)
def _headings(starts: Shorts, runs: Runs, points: Array, where: Ints, centres: Array, window: float) -> Bools:
    seen = np.zeros((len(centres), HEADING_BINS), np.bool_)
    half = min(round(window / (2 * math.pi) * HEADING_BINS), HEADING_BINS // 2)
    for t in range(len(points)):
        for k in range(starts[t], starts[t + 1]):
            for column in range(runs[k, 1], runs[k, 2]):
                n = where[runs[k, 0], column]
                if n >= 0:
                    direction = math.atan2(points[t, 1] - centres[n, 1], points[t, 0] - centres[n, 0])
                    middle = math.floor(direction / (2 * math.pi) * HEADING_BINS)
                    for b in range(middle - half, middle + half + 1):
                        seen[n, b % HEADING_BINS] = True
    return seen


class LineOfSight(Stage):
    """Computes the visibility areas of a map's references: the free cells that see what the references look at.

    Wolf, Burgard & Burkhardt 2005, section V: lambda is the closest occupied cell along a view's optical axis; its
    visibility area are the free cells from which lambda is visible, found by constrained region growing. Occupied and
    unknown cells block (erratum 46). Only the face of lambda that the view hits counts, so that no view is seen through
    a thin wall. A panorama has one area per segment of its features, along the segment's middle; a forward-looking
    camera has one, straight ahead. A reference outside the free cells has none, nor has a ray that ends in unknown
    cells.
    """

    class Out(Outputs):
        """`areas`, and what share of the free space they cover."""

        areas: VisibilityAreas
        metrics: Metrics

    def step(self, ctx: Context, map: ReferenceGraph, grid: OccupancyGrid, free: FreeSpace | None = None) -> Out:
        if max(grid.cells.shape) > MAX_CELLS_PER_SIDE:
            raise BadInput(
                f"grid: {grid.cells.shape} cells are more than {MAX_CELLS_PER_SIDE} a side; use a coarser resolution"
            )
        axes = axes_of(max(map.features.shape[1], 1))
        areas = visibility_areas(map.poses, grid, axes)
        none = int((areas.target < 0).sum())
        if none == areas.target.size:
            raise BadInput(
                "grid: no reference of the map sees an occupied cell in it; are both in the same frame? The map's "
                f"poses come from {SOURCE_WORDS[map.pose_source]}"
            )
        if map.pose_source in OWN_FRAMES and grid.made_from != "tour":
            ctx.warn(
                f"The map's poses are from {SOURCE_WORDS[map.pose_source]}, in a frame of their own, and the grid "
                "is in another; learn the map with true poses in the grid's frame, or type grid=from_tour"
            )
        if none:
            ctx.count("view_without_area", none, "areas: the view hits no occupied cell of the grid")
        places = grid.centres(*np.nonzero(grid.cells == FREE)) if free is None else free.centres
        place, state = covered(areas, places, math.radians(WITHIN_DEG) if len(axes) == 1 else math.pi)
        cells = np.concatenate([[0.0], np.cumsum(areas.runs[:, 2] - areas.runs[:, 1], dtype=np.float64)])
        figures = {
            "references": len(map),
            "areas": areas.target.size - none,
            "points": len(areas.points),
            "area_median_m2": float(np.median(np.diff(cells[areas.starts]))) * grid.resolution**2,
            "free_m2": len(places) * grid.resolution**2,
            "covered_rate": place,
            "covered_with_heading_rate": state,
            "size_bytes": areas.nbytes,
            "grid": grid.made_from,
        }
        return self.Out(areas=areas, metrics=Metrics({"visibility": figures}))
