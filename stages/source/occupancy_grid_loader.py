"""The occupancy grid of where the robot drives, and where in it the robot may be."""

import math
from pathlib import Path
from typing import Annotated, Any

import cv2
import numpy as np

from omninav.pipeline import BadInput, Bounds, Context, Outputs, Stage, user_path
from omninav.stages.geometry.arrays import Array, Bools, Ints
from omninav.stages.recordings.occupancy_grid import MAX_CELLS, coarser, grid_beside, grid_digest, read_occupancy
from omninav.stages.values.grid import FREE, OCCUPIED, UNKNOWN, FreeSpace, OccupancyGrid
from omninav.stages.values.length_scale import LengthScale, metres_of
from omninav.stages.values.maps import ReferenceGraph

FROM_TOUR = "from_tour"
CLEARANCE_M = 0.2
"""Least distance of free space from anything occupied, metres."""
MAX_OFF = 0.1
"""Share of a map's references outside free cells, above which a run warns that its grid may be another's."""
PATH_HALF_WIDTH = 2.0
"""Distance from the path up to which a stand-in is free, in length scales of the appearance."""


class OccupancyGridLoader(Stage):
    """Gives the occupancy grid of a place, and the free space that a robot reaches.

    Free space is what keeps clear of anything occupied and, with `map` wired, is connected to its references; that of a
    stand-in for a grid (see `along_path`) is all of it. Raises BadInput where there is a log and no grid.
    """

    grid: str | None = None
    """A map_server file, or its folder; from_tour: a stand-in made of the free path of the map's references; null: the
    one that is wired as `known`."""
    resolution_m: Annotated[float, Bounds(gt=0)] = 0.1
    """Side of a cell, about: a file's cells are merged, not split."""
    log: str | tuple[str, ...] | None = None
    """The log that is driven: its grid is not known, unless `grid` names it."""
    tour: str | tuple[str, ...] | None = None
    """The log that the map was made from; grids beside it are suggested."""

    class Out(Outputs):
        """`grid`, and `free`: where the robot may be."""

        grid: OccupancyGrid
        free: FreeSpace

    def inputs_digest(self) -> str | None:
        """Reads the file, if there is one. Raises BadInput where there is a log and no grid, before anything runs."""
        file = self._file()
        if file is None:
            return None
        self._read(file)
        return grid_digest(file)

    def step(
        self,
        ctx: Context,
        known: OccupancyGrid | None = None,
        map: ReferenceGraph | None = None,
        length_scale: LengthScale | None = None,
    ) -> Out:
        """Read, take or make the grid."""
        file = self._file()
        if self.grid == FROM_TOUR:
            if map is None or not len(map):
                raise BadInput("grid: from_tour needs a map with references; give tour=FILE, or grid=FOLDER/map.yaml")
            unit = metres_of(length_scale)
            grid = along_path(map.poses, map.edges, PATH_HALF_WIDTH * unit, self.resolution_m)
            ctx.fact(
                "grid",
                "a stand-in made from the tour's path: free along it, walls around it, wherever the real ones are",
            )
            ctx.count("grid_is_a_stand_in", detail="grid: made from the tour's path; a map_server file is better")
        elif file is not None:
            grid = self._read(file)
            ctx.fact("grid", file.name)
        elif known is not None:
            grid = known
        else:
            raise BadInput(f"grid: none is named; give grid=FOLDER/map.yaml (of ROS map_server), or grid={FROM_TOUR}")
        clearance = 0.0 if grid.made_from == "tour" else CLEARANCE_M
        poses = None if map is None else map.poses
        if poses is not None and (off := int((~in_cells(grid, poses, grid.cells == FREE)).sum())) > MAX_OFF * len(
            poses
        ):
            ctx.warn(
                f"{off} of the map's {len(poses)} references are not in free cells of the grid: is it of this place, "
                "and in the frame of the map's poses?"
            )
        space = free_space(grid, clearance, poses) or free_space(grid, clearance, None)
        if space is None:
            raise BadInput(
                f"grid: no cell is free and {clearance:g} m from obstacles; give a grid in which a robot has room"
            )
        return self.Out(grid=grid, free=space)

    def _read(self, file: Path) -> OccupancyGrid:
        """The grid in a file. Raises BadInput also where it leaves a robot no room."""
        grid = coarser(read_occupancy(file), self.resolution_m)
        if free_space(grid, CLEARANCE_M, None) is None:
            raise BadInput(
                f"{file}: no cell is free and {CLEARANCE_M:g} m from obstacles; give a grid in which a robot has room"
            )
        return grid

    def _file(self) -> Path | None:
        if self.grid == FROM_TOUR:
            return None
        if self.grid is not None:
            file = user_path(self.grid)
            if file.is_dir():
                file = file / "map.yaml"
            if not file.is_file():
                raise BadInput(f"grid: {file} is no file; give a map_server map, or grid={FROM_TOUR}")
            return file
        if self.log is None and self.tour is None:
            return None
        beside = grid_beside(self.tour) or grid_beside(self.log)
        known = f"grid={beside}" if beside is not None else "grid=FOLDER/map.yaml (of ROS map_server)"
        raise BadInput(
            f"grid: visibility areas need an occupancy grid, and a log brings none; give {known}, or grid={FROM_TOUR}, "
            "a stand-in made from the tour's free path"
        )


def free_space(grid: OccupancyGrid, clearance: float, references: Array | None) -> FreeSpace | None:
    """Free cells whose centre is at least `clearance` metres from any occupied cell; None where there are none.

    With `references` (R, >= 2), only what is connected to one of them.
    """
    free = grid.cells == FREE
    if clearance > 0.0 and (grid.cells == OCCUPIED).any():
        gap = cv2.distanceTransform((grid.cells != OCCUPIED).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
        free &= grid.resolution * (gap - 0.5) >= clearance
    if references is not None:
        _, labels = cv2.connectedComponents(free.astype(np.uint8), connectivity=8)
        row, column = grid.cells_of(references[in_cells(grid, references, free)]).T
        free &= np.isin(labels, labels[row, column])
    return FreeSpace(grid.centres(*np.nonzero(free)), grid.resolution) if free.any() else None


def in_cells(grid: OccupancyGrid, points: Array, chosen: Bools) -> Bools:
    """Tells which points (N, >= 2; m, map frame) are in the grid's chosen cells (rows, columns): (N,)."""
    row, column = grid.cells_of(points).T
    inside: Bools = (row >= 0) & (row < chosen.shape[0]) & (column >= 0) & (column < chosen.shape[1])
    inside[inside] = chosen[row[inside], column[inside]]
    return inside


def along_path(poses: Array, edges: Ints, reach: float, resolution: float) -> OccupancyGrid:
    """A grid that stands in for an unknown one: free within `reach` metres of a path, with a wall around it.

    The path are places (R, >= 2) and the straight `edges` (E, 2) between them. The wall is one cell thick; what is
    behind it is unknown. So a view sees the end of the free path ahead of it, and its visibility area is the stretch of
    path from which that end is in sight: right along the path and beside it, and never through what nobody drove along.
    """
    from scipy.spatial import KDTree  # slow to import: not before a run

    places: Array = np.asarray(poses[:, :2], np.float64)
    if len(edges):
        ends = places[edges]
        steps = max(1, math.ceil(float(np.hypot(*(ends[:, 1] - ends[:, 0]).T).max()) / resolution))
        between = np.linspace(0.0, 1.0, steps + 1)[:, None, None]
        places = np.concatenate([places, ((1 - between) * ends[:, 0] + between * ends[:, 1]).reshape(-1, 2)])
    margin = reach + 2 * resolution
    origin = np.floor((places.min(axis=0) - margin) / resolution) * resolution
    columns, rows = (int(n) for n in np.ceil((places.max(axis=0) + margin - origin) / resolution))
    if rows * columns > MAX_CELLS:
        raise BadInput(
            f"grid: a stand-in of {columns} x {rows} cells along the map's path, expected at most {MAX_CELLS:,}; use "
            "a larger resolution_m, or give grid=FOLDER/map.yaml"
        )
    grid = OccupancyGrid(
        np.full((rows, columns), UNKNOWN, np.uint8), resolution, (float(origin[0]), float(origin[1])), "tour"
    )
    tree: Any = KDTree(places)
    centres = grid.centres(*np.divmod(np.arange(rows * columns), columns))
    free: Bools = np.isfinite(tree.query(centres, distance_upper_bound=reach)[0]).reshape(rows, columns)
    grid.cells[cv2.dilate(free.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0] = OCCUPIED
    grid.cells[free] = FREE
    return grid
