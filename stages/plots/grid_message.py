"""An occupancy grid, or a floor plan, as nav_msgs/OccupancyGrid."""

import math

import cv2
import numpy as np

from omninav.stages.plots.pose_messages import MAP, Fields, header, ros_pose
from omninav.stages.values.floor_plan import FloorPlan
from omninav.stages.values.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid

CELL_M = 0.05
"""Width of a cell of a floor plan up to 50 m; of a larger one as many times that as keep it within 1000 cells."""


def grid_message(plan: FloorPlan | OccupancyGrid, stamp: int) -> Fields:
    """Occupied cells are 100, free ones 0, unknown ones -1; the frame is the map's."""
    grid = plan if isinstance(plan, OccupancyGrid) else _drawn(plan)
    values = np.zeros(3, np.int8)
    values[[FREE, OCCUPIED, UNKNOWN]] = 0, 100, -1
    rows, columns = grid.cells.shape
    origin = ros_pose(np.array([*grid.origin, 0.0]))
    info = {"resolution": grid.resolution, "width": columns, "height": rows, "origin": origin}
    return {"header": header(stamp, MAP), "info": info, "data": values[grid.cells].ravel()}


def _drawn(plan: FloorPlan) -> OccupancyGrid:
    corners = plan.outlines.reshape(-1, 2)
    low = np.minimum(corners.min(axis=0, initial=0.0), 0.0)
    high = np.maximum(corners.max(axis=0, initial=0.0), [plan.width, plan.depth])
    cell = CELL_M * max(1, math.ceil(float((high - low).max()) / (1000 * CELL_M)))
    columns, rows = np.ceil((high - low) / cell).astype(int).tolist()
    cells = np.full((max(rows, 1), max(columns, 1)), FREE, np.uint8)
    fine = 16  # cv2 takes corners in sixteenths of a cell
    outlines = np.round(((plan.outlines - low) / cell - 0.5) * fine).astype(np.int32)
    for outline in outlines:
        cv2.fillPoly(cells, [outline], OCCUPIED, shift=4)
    return OccupancyGrid(cells, cell, (float(low[0]), float(low[1])))
