"""Obstacles with fast queries: distance to the nearest one, and range along a ray."""

import math
from typing import NamedTuple

import numpy as np

from omninav.pipeline.engine.compiled import compiled
from omninav.stages.geometry.arrays import Array, Shorts
from omninav.stages.geometry.plane.grid_rays import cells_along

from .bodies import boxes_of_cells

CELL = 1.0
"""Size (m) of the cells in which boxes are looked up."""


class Obstacles(NamedTuple):
    """Boxes by the cells they are near to.

    `boxes` (B, 6): centre x, y, cosine and sine of the yaw, half length, half depth. `start` (cells + 1,) and
    `members`: which boxes are within `reach` m of each cell. `rows`, `columns`: of cells, the first at 0, 0. `width`,
    `depth`: of the floor; what is beyond is no room to drive.
    """

    boxes: Array
    start: Shorts
    members: Shorts
    rows: int
    columns: int
    width: float
    depth: float
    reach: float


def gather(boxes: Array, size: tuple[float, float], reach: float) -> Obstacles:
    """Obstacles from boxes (B, >= 6), as `box_array` has them, on a floor of `size` m, known up to `reach` m away."""
    boxes = np.ascontiguousarray(boxes[:, :6])
    rows, columns = max(1, math.ceil(size[1] / CELL)), max(1, math.ceil(size[0] / CELL))
    start, members = boxes_of_cells(boxes, reach, np.zeros(2), CELL, rows, columns)
    return Obstacles(boxes, start, members, rows, columns, float(size[0]), float(size[1]), reach)


@compiled(error_model="numpy")
def nearest(obstacles: Obstacles, people: Array, x: float, y: float) -> tuple[float, float, float]:
    """Distance (m) of a point to the nearest obstacle, at most `reach`, and the direction x, y that leads away from it.

    `people` (M, 3): x, y, radius of round bodies. Inside an obstacle the distance is negative; the direction there
    leads out over the nearest side.
    """
    least, away_x, away_y = obstacles.reach, 0.0, 0.0
    for distance, nx, ny in (
        (x, 1.0, 0.0),
        (obstacles.width - x, -1.0, 0.0),
        (y, 0.0, 1.0),
        (obstacles.depth - y, 0.0, -1.0),
    ):
        if distance < least:
            least, away_x, away_y = distance, nx, ny
    column = min(max(int(x / CELL), 0), obstacles.columns - 1)
    row = min(max(int(y / CELL), 0), obstacles.rows - 1)
    cell = row * obstacles.columns + column
    for k in range(obstacles.start[cell], obstacles.start[cell + 1]):
        box = obstacles.boxes[obstacles.members[k]]
        cos, sin = box[2], box[3]
        along = cos * (x - box[0]) + sin * (y - box[1])
        across = cos * (y - box[1]) - sin * (x - box[0])
        over, beside = abs(along) - box[4], abs(across) - box[5]
        if over > 0.0 or beside > 0.0:
            u, v = max(over, 0.0), max(beside, 0.0)
            distance = math.hypot(u, v)
        else:
            distance = max(over, beside)
            u, v = (1.0, 0.0) if over > beside else (0.0, 1.0)
        if distance < least:
            size = math.hypot(u, v)
            u, v = math.copysign(u, along) / size, math.copysign(v, across) / size
            least, away_x, away_y = distance, cos * u - sin * v, sin * u + cos * v
    for k in range(len(people)):
        dx, dy = x - people[k, 0], y - people[k, 1]
        far = math.hypot(dx, dy)
        if far - people[k, 2] < least:
            least = far - people[k, 2]
            away_x, away_y = (dx / far, dy / far) if far > 0.0 else (1.0, 0.0)
    return least, away_x, away_y


@compiled(error_model="numpy")
def distances(obstacles: Obstacles, points: Array) -> Array:
    """Distances (N,) of points (N, 2) to the nearest obstacle, at most `reach`; 0 inside one or beyond the floor."""
    nobody = np.zeros((0, 3))
    found = np.empty(len(points))
    for k in range(len(points)):
        found[k] = max(nearest(obstacles, nobody, points[k, 0], points[k, 1])[0], 0.0)
    return found


@compiled(error_model="numpy")
def beam(obstacles: Obstacles, people: Array, x: float, y: float, dx: float, dy: float, farthest: float) -> float:
    """Distance (m) along a unit direction to the first box or person, infinite beyond `farthest`."""
    best = np.inf
    for k in range(len(people)):
        px, py = people[k, 0] - x, people[k, 1] - y
        along = px * dx + py * dy
        square = people[k, 2] ** 2 - (px * px + py * py - along * along)
        if square >= 0.0:
            enter = along - math.sqrt(square)
            if along + math.sqrt(square) >= 0.0:
                best = min(best, max(enter, 0.0))
    row, column = math.floor(y / CELL), math.floor(x / CELL)
    if not (0 <= row < obstacles.rows and 0 <= column < obstacles.columns):
        return best if best <= farthest else np.inf
    best = min(best, _first_box(obstacles, row, column, x, y, dx, dy))
    for i, j, _, entered in cells_along(y / CELL, x / CELL, dy, dx):
        outside = not (0 <= i < obstacles.rows and 0 <= j < obstacles.columns)
        if outside or entered * CELL > min(farthest, best):
            break
        best = min(best, _first_box(obstacles, i, j, x, y, dx, dy))
    return best if best <= farthest else np.inf


@compiled(error_model="numpy")
def _first_box(obstacles: Obstacles, row: int, column: int, x: float, y: float, dx: float, dy: float) -> float:
    """Distance at which a ray enters the first of a cell's boxes; infinite without one."""
    best, cell = np.inf, row * obstacles.columns + column
    for k in range(obstacles.start[cell], obstacles.start[cell + 1]):
        best = min(best, _enter(obstacles.boxes[obstacles.members[k]], x, y, dx, dy))
    return best


@compiled(error_model="numpy")
def _enter(box: Array, x: float, y: float, dx: float, dy: float) -> float:
    """Distance at which a ray enters a box; 0 inside, infinite where it misses."""
    cos, sin = box[2], box[3]
    u, v = cos * (x - box[0]) + sin * (y - box[1]), cos * (y - box[1]) - sin * (x - box[0])
    du, dv = cos * dx + sin * dy, cos * dy - sin * dx
    first, last = 0.0, np.inf
    for position, slope, half in ((u, du, box[4]), (v, dv, box[5])):
        if abs(slope) < 1e-12:
            if abs(position) > half:
                return np.inf
        else:
            one, other = (-half - position) / slope, (half - position) / slope
            first, last = max(first, min(one, other)), min(last, max(one, other))
    return first if first <= last else np.inf
