"""Occupancy grids as ROS map_server keeps them."""

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
import yaml

from omninav.pipeline.graph.problems import BadInput
from omninav.stages.values.floor_plan import FloorPlan
from omninav.stages.values.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid


def grid_beside(logs: str | Sequence[str] | None) -> Path | None:
    """The occupancy grid beside the first log that has one: `drive.grid/map.yaml` beside drive.mcap, or `map.yaml`."""
    for path in (Path(log).expanduser() for log in ((logs,) if isinstance(logs, str) else logs or ())):
        for grid in (path.parent / f"{path.stem}.grid" / "map.yaml", path.parent / "map.yaml"):
            if path.exists() and grid.is_file():
                return grid
    return None


def read_occupancy(file: Path) -> OccupancyGrid:
    """The grid in a map_server pair (`map.yaml`, which names its image). Raises BadInput where it cannot be read.

    Occupied is what is darker than `occupied_thresh` says (lighter with `negate`), free what is lighter than
    `free_thresh`, and what lies between is unknown, in the modes `trinary` and `scale`. In the mode `raw` levels are
    per cent, and those above 100 unknown. A turned origin is refused.
    """
    try:
        content = yaml.safe_load(file.read_text())
        resolution, (x, y, turn) = float(content["resolution"]), map(float, content["origin"])
        occupied, free = float(content.get("occupied_thresh", 0.65)), float(content.get("free_thresh", 0.196))
        negate, mode = bool(content.get("negate", 0)), str(content.get("mode", "trinary"))
        image = file.parent / str(content["image"])
    except (OSError, ValueError, TypeError, KeyError, yaml.YAMLError) as error:
        why = " ".join(str(error).split())
        raise BadInput(f"{file}: not a map_server map ({why}); give the .yaml beside a map's image") from None
    levels = cv2.imread(str(image), cv2.IMREAD_GRAYSCALE)
    if levels is None:
        raise BadInput(f"{file}: its image {image.name} cannot be read")
    if mode not in ("trinary", "scale", "raw"):
        raise BadInput(f"{file}: its mode is '{mode}'; map_server knows trinary, scale and raw")
    if turn:
        raise BadInput(f"{file}: its origin is turned by {turn} rad, which is not supported")
    if not resolution > 0.0:
        raise BadInput(f"{file}: its resolution is {resolution:g} m; write the width of a cell in metres")
    if mode == "raw":
        filled = np.where(levels > 100, np.nan, levels / 100.0)
    else:
        filled = levels / 255.0 if negate else 1.0 - levels / 255.0
    cells = np.full(levels.shape, UNKNOWN, np.uint8)
    cells[filled > occupied] = OCCUPIED
    cells[filled < free] = FREE
    return OccupancyGrid(np.ascontiguousarray(cells[::-1]), resolution, (x, y))


def coarser(grid: OccupancyGrid, resolution: float) -> OccupancyGrid:
    """A grid whose cells are as many whole ones of the given as come nearest to `resolution` metres; never a finer one.

    A cell is occupied where any of its own is; else unknown where any is, as unknown ones block the view (erratum 46 in
    docs/papers.md).
    """
    factor = max(1, round(resolution / grid.resolution))
    if factor == 1:
        return grid
    rows, columns = (-(-size // factor) for size in grid.cells.shape)
    padded = np.full((rows * factor, columns * factor), UNKNOWN, np.uint8)
    padded[: grid.cells.shape[0], : grid.cells.shape[1]] = grid.cells
    blocks = padded.reshape(rows, factor, columns, factor)
    cells = np.where((blocks == UNKNOWN).any(axis=(1, 3)), UNKNOWN, FREE).astype(np.uint8)
    cells[(blocks == OCCUPIED).any(axis=(1, 3))] = OCCUPIED
    return OccupancyGrid(cells, grid.resolution * factor, grid.origin, grid.made_from)


def read_grid(file: Path) -> FloorPlan:
    """What is occupied in a map_server pair, as boxes. Raises BadInput as `read_occupancy`."""
    grid = read_occupancy(file)
    rows, columns = grid.cells.shape
    cells, (x, y) = boxes(grid.cells == OCCUPIED), grid.origin
    corners = (cells[:, [[0, 1], [2, 1], [2, 3], [0, 3]]] * grid.resolution + (x, y)).astype(np.float64)
    return FloorPlan(corners, x + columns * grid.resolution, y + rows * grid.resolution)


def boxes(occupied: npt.NDArray[np.bool_]) -> npt.NDArray[np.int64]:
    """Occupied cells (rows, columns) as few boxes: (B, 4) first column, first row, column and row after the last.

    Runs of a row that stand in the next row as well are one box.
    """
    edges = np.diff(occupied.astype(np.int8), axis=1, prepend=0, append=0)
    found: list[tuple[int, int, int, int]] = []
    open_: dict[tuple[int, int], int] = {}  # a run's columns -> the row where it began
    for row in range(len(occupied) + 1):
        line = edges[row] if row < len(occupied) else edges[:0].reshape(-1)
        runs = list(zip(np.flatnonzero(line > 0).tolist(), np.flatnonzero(line < 0).tolist(), strict=True))
        for run in [run for run in open_ if run not in runs]:
            found.append((run[0], open_.pop(run), run[1], row))
        for run in runs:
            open_.setdefault(run, row)
    return np.array(found, np.int64).reshape(-1, 4)
