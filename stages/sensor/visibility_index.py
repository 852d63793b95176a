"""Index of what can be seen from each cell of a grid, by the visibility areas of a map's references."""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from omninav.pipeline.engine.compiled import compiled
from omninav.stages.geometry.arrays import Array, Bools, Floats, Ints, Shorts
from omninav.stages.geometry.plane.point_cells import distinct
from omninav.stages.values.grid import cells_of
from omninav.stages.values.visibility import VisibilityAreas

Numbers = npt.NDArray[np.uint32]


class Looks(NamedTuple):
    """The points that the views of a map look at, in groups: all views of one point, or each view on its own.

    `target` (G,): the point of a group; `point` (G, 2): its position (m); `place` (G, 2): mean position of the views
    (m); `bearing` (G,): bearing of the point from the robot of the first view (rad). The views of group g are rows
    `starts[g]` to `starts[g + 1]` of `reference` (A,), their references, and `turned` (A,), how much farther to the
    left than in the first view the robot sees the point (rad). The groups with a view of reference r are
    `groups_of[of_reference[r] : of_reference[r + 1]]`.
    """

    target: Shorts
    point: Array
    place: Array
    bearing: Array
    starts: Ints
    reference: Shorts
    turned: Array
    of_reference: Ints
    groups_of: Shorts

    def groups_with(self, references: Ints) -> Ints:
        """The groups that have a view of any of these references, ascending."""
        first, number = self.of_reference[references], self.of_reference[references + 1] - self.of_reference[references]
        at = np.repeat(first - np.cumsum(number) + number, number) + np.arange(number.sum())
        return distinct(self.groups_of[at].astype(np.int64))


class Cells(NamedTuple):
    """The groups seen from each cell of a grid: from cell n (row by row) `items[starts[n] : starts[n + 1]]`.

    `origin` x, y (m) of the lower left corner; `resolution` (m); `rows`, `columns`. `places` (G, 5) float32: where each
    group's point and its views are from the origin (m), and its bearing (turns). `most`: groups seen from any cell.
    """

    starts: Ints
    items: Numbers
    origin: tuple[float, float]
    resolution: float
    rows: int
    columns: int
    places: Floats
    most: int


def looks_at(areas: VisibilityAreas, poses: Array, each_view: bool = False) -> Looks:
    """Group the views of references at `poses` (R, 3) by the point they look at, or keep each on its own."""
    reference, sector = np.nonzero(areas.target >= 0)
    target = areas.target[reference, sector]
    order = np.argsort(target, kind="stable")
    reference, target = reference[order], target[order]
    place, point = poses[reference, :2], areas.points[target]
    bearing = np.arctan2(*(point - place).T[::-1]) - poses[reference, 2]
    views = np.arange(len(target) + 1)
    starts = views if each_view else np.append(np.flatnonzero(np.diff(target, prepend=-1)), len(target))
    first, number = starts[:-1], np.diff(starts)
    mean = np.add.reduceat(place, first, axis=0) / number[:, None] if len(first) else place
    turned = bearing - np.repeat(bearing[first], number)
    by_reference = np.argsort(reference, kind="stable")
    groups = np.repeat(np.arange(len(number), dtype=np.int32), number)[by_reference]
    of_reference = np.searchsorted(reference[by_reference], np.arange(len(poses) + 1))
    short: Shorts = reference.astype(np.int32)
    return Looks(target[first], point[first], mean, bearing[first], starts, short, turned, of_reference, groups)


def seen_from(areas: VisibilityAreas, looks: Looks, within: float = math.inf) -> Cells:
    """Index the groups seen from each cell: those whose point is visible, taken `within` metres of any spot of it."""
    radius = within / areas.resolution + math.sqrt(0.5)  # in cells, from the middle of one to its corners
    middle = (looks.place - areas.origin) / areas.resolution - 0.5
    starts, items = _by_cell(areas.starts, areas.runs, *areas.shape, looks.target, middle, radius)
    turns = looks.bearing / (2 * math.pi) % 1.0
    places = np.column_stack([looks.point - areas.origin, looks.place - areas.origin, turns]).astype(np.float32)
    most = max(1, int(np.diff(starts).max(initial=0)))
    return Cells(starts, items, areas.origin, areas.resolution, *areas.shape, places, most)


@compiled(nogil=True)
def _by_cell(
    starts: Shorts, runs: npt.NDArray[np.uint16], rows: int, columns: int, target: Shorts, middle: Array, radius: float
) -> tuple[Ints, Numbers]:
    first, filled, items = np.zeros(rows * columns + 1, np.int64), np.empty(0, np.int64), np.empty(0, np.uint32)
    for listed in (False, True):
        for g in range(len(target)):
            for k in range(starts[target[g]], starts[target[g] + 1]):
                up = float(runs[k, 0]) - middle[g, 1]
                if abs(up) > radius:
                    continue
                wide, row = math.sqrt(radius * radius - up * up), int(runs[k, 0]) * columns
                left = int(max(float(runs[k, 1]), np.ceil(middle[g, 0] - wide)))
                behind = int(min(float(runs[k, 2]), np.floor(middle[g, 0] + wide) + 1.0))
                for cell in range(row + left, row + behind):
                    if listed:
                        items[filled[cell]] = g
                        filled[cell] += 1
                    else:
                        first[cell + 1] += 1
        if not listed:
            first = np.cumsum(first)
            filled, items = first[:-1].copy(), np.empty(first[-1], np.uint32)
    return first, items


def sees_any(poses: Array, cells: Cells) -> Bools:
    """Tells whether any group is seen from poses (N, 3): (N,)."""
    row, column = cells_of(poses, cells.origin, cells.resolution).T
    inside = (row >= 0) & (row < cells.rows) & (column >= 0) & (column < cells.columns)
    number = np.where(inside, row * cells.columns + column, 0)
    return np.asarray(inside & (cells.starts[number + 1] > cells.starts[number]))
