"""Occupancy grids and free space."""

from typing import Annotated, Literal

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Shape, Value
from omninav.stages.geometry.arrays import Array, Ints

Cells = npt.NDArray[np.uint8]

FREE, OCCUPIED, UNKNOWN = 0, 1, 2
"""States of a cell."""

GridSource = Literal["map", "world", "tour"]
"""Origin of a grid: a map file, the built-in world, or a stand-in made from the free path of a tour."""


class OccupancyGrid(Value):
    """Cells of the plane that are free, occupied or unknown (the constants of this file).

    `cells`: (rows, columns) uint8, row 0 at the lowest y. `resolution`: a cell's width (m). `origin`: x, y (m, map
    frame) of the lower left corner of cell (0, 0). `made_from`: what it is.
    """

    cells: Annotated[Cells, Shape("rows", "columns"), Bounds(ge=FREE, le=UNKNOWN)]
    resolution: Annotated[float, Bounds(gt=0)]
    origin: tuple[float, float]
    made_from: GridSource = "map"

    def cells_of(self, points: Array) -> Ints:
        """Row and column of the cells in which points (N, >= 2) are: (N, 2), also of cells that are not there."""
        return cells_of(points, self.origin, self.resolution)

    def centres(self, rows: Ints, columns: Ints) -> Array:
        """Centres (m) of cells: (N, 2)."""
        centres: Array = np.array(self.origin) + self.resolution * (np.column_stack([columns, rows]) + 0.5)
        return centres


def cells_of(points: Array, origin: tuple[float, float], resolution: float) -> Ints:
    """Row and column of the cells in which points (N, >= 2) are: (N, 2)."""
    cells: Ints = np.floor((points[:, 1::-1] - origin[::-1]) / resolution).astype(np.int64)
    return cells


class FreeSpace(Value):
    """The positions where the robot may be. `centres`: (N, 2) x, y (m, map frame) of square cells; `cell`: their width
    (m)."""

    centres: Annotated[Array, Shape("N", 2)]
    cell: Annotated[float, Bounds(gt=0)]

    def draw(self, rng: np.random.Generator, number: int) -> Array:
        """Draw poses uniformly over the cells and headings: (number, 3) m, m, rad."""
        poses = np.empty((number, 3))
        chosen = rng.integers(len(self.centres), size=number)
        poses[:, :2] = self.centres[chosen] + self.cell * (rng.random((number, 2)) - 0.5)
        poses[:, 2] = rng.uniform(-np.pi, np.pi, number)
        return poses
