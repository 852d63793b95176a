"""Draws maps, grids and floor plans under what else is on a chart of the plane."""

import cv2
import numpy as np

from omninav.pipeline.report.chart import Chart, Colour, Layer, broken
from omninav.stages.geometry.arrays import Array, Bytes
from omninav.stages.values.floor_plan import FloorPlan
from omninav.stages.values.grid import OCCUPIED, OccupancyGrid
from omninav.stages.values.map_places import AnyMap
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import OWN_FRAMES
from omninav.stages.values.topological_map import TopologicalMap
from omninav.stages.values.view_mixtures import ViewMixtures

from .drawing import extent_of, grid_extent, shown_landmarks

Extent = tuple[float, float, float, float]

STANDING = (152, 143, 139)
"""Grey (blue-green-red) of what is on the floor, on light and on dark pages."""
SPECKS_PX = 500
"""Length of the longer side of the picture of landmarks, pixels."""
JUMP_M = 2.5
"""A line is interrupted where an estimate jumps farther (m): nobody drove there."""


def plan_chart(extent: Extent | None, height: tuple[float, float] = (190.0, 520.0)) -> Chart:
    """A chart of the plane, metres both ways, that shows at least `extent` (x from, x to, y from, y to)."""
    x0, x1, y0, y1 = extent or (0.0, 1.0, 0.0, 1.0)
    return Chart((x0, x1), (y0, y1), "x (m)", "y (m)", equal=True, height=height)


def draw_surroundings(chart: Chart, map: AnyMap | None, grid: OccupancyGrid | None, plan: FloorPlan | None) -> None:
    """Draws what is on the floor, by the grid or else the plan, and the map's references or places over it.

    A grid or plan in another frame than a map of odometry is left out.
    """
    if isinstance(map, ReferenceGraph) and map.pose_source in OWN_FRAMES:
        grid, plan = grid if grid is not None and grid.made_from == "tour" else None, None
    if grid is not None:
        chart.base.raster(tinted(np.where(grid.cells[::-1] == OCCUPIED, 190, 0).astype(np.uint8)), grid_extent(grid))
        chart.name("occupied", "grey", "square")
    elif plan is not None and len(plan.outlines):
        chart.base.raster(*_outlines(plan))
        chart.name("obstacles", "grey", "square")
    if map is not None and len(map):
        draw_map(chart, map)


def draw_map(chart: Chart, map: AnyMap) -> None:
    """References as small hollow-looking dots, joined by their edges; places of a topological map, joined by links."""
    if isinstance(map, ViewMixtures):
        chart.base.dots(map.means, "grey", _size(len(map.weights)), 0.8)
        chart.name(f"views ({len(map)}) at {len(map.weights)} places", "grey", "dot")
        return
    if isinstance(map, TopologicalMap):
        poses = map.poses[map.places]
        lines = [map.poses[map.whole_way(link)] for link in range(len(map.links))]
        draw_lines(chart.base, lines, "line", 0.9)
        chart.base.dots(poses, "grey", 4.0)
        chart.name(f"places ({len(map)})", "grey", "dot")
        return
    draw_lines(chart.base, list(map.poses[map.edges]), "line", 0.9)
    chart.base.dots(map.poses, "grey", _size(len(map)), 0.8)
    chart.name(f"references ({len(map)})", "grey", "dot")


def draw_landmarks(chart: Chart, map: AnyMap | None) -> None:
    """A map's landmarks from above as faint specks; call it before what is drawn over them."""
    if not isinstance(map, ReferenceGraph) or map.landmarks is None or not len(map.landmarks):
        return
    xy = shown_landmarks(map.landmarks)
    extent = extent_of(xy, margin=0.0) or (0.0, 1.0, 0.0, 1.0)
    columns, rows = (
        max(1, round(SPECKS_PX * (b - a) / max(extent[1] - extent[0], extent[3] - extent[2])))
        for a, b in (extent[:2], extent[2:])
    )
    edges = [[extent[2], extent[3]], [extent[0], extent[1]]]
    counts = np.histogram2d(xy[:, 1], xy[:, 0], (rows, columns), edges)[0][::-1]
    chart.base.raster(tinted(np.where(counts > 0, np.clip(60 + 40 * counts, 0, 180), 0).astype(np.uint8)), extent)
    chart.name(f"landmarks ({len(map.landmarks)})", "grey", "square")


def jumps(path: Array) -> list[int]:
    """The rows of a path (N, 2 or more) that are farther than `JUMP_M` from the row before."""
    far: list[int] = (np.flatnonzero(np.hypot(*np.diff(path[:, :2], axis=0).T) > JUMP_M) + 1).tolist()
    return far


def _size(number: int) -> float:
    return float(np.clip(600 / max(number, 1), 1.1, 2.4))


def draw_lines(layer: Layer, lines: list[Array], colour: Colour, width: float) -> None:
    """Lines, each through points (N, 2 or more), as one mark."""
    if lines:
        ends = np.cumsum([len(line) for line in lines])[:-1].tolist()
        layer.line(broken(np.concatenate([line[:, :2] for line in lines]), ends), colour, width)


def _outlines(plan: FloorPlan) -> tuple[bytes, Extent]:
    extent = extent_of(plan.outlines.reshape(-1, 2), margin=0.0) or (0.0, plan.width, 0.0, plan.depth)
    scale = 1400 / max(extent[1] - extent[0], extent[3] - extent[2])
    size = round((extent[3] - extent[2]) * scale), round((extent[1] - extent[0]) * scale)
    covered = np.zeros((max(size[0], 1), max(size[1], 1)), np.uint8)
    corners = (plan.outlines - (extent[0], extent[2])) * scale
    for outline in np.round(corners * 16).astype(np.int32):
        cv2.fillPoly(covered, [outline], 110, cv2.LINE_AA, 4)
    return tinted(covered[::-1]), extent


def tinted(opacity: Bytes, colour: tuple[int, int, int] = STANDING) -> bytes:
    """PNG bytes of one colour (blue-green-red), as opaque as given (rows, columns)."""
    pixels = np.empty((*opacity.shape, 4), np.uint8)
    pixels[:, :, :3], pixels[:, :, 3] = colour, opacity
    return cv2.imencode(".png", pixels)[1].tobytes()
