"""Occupancy grids as ROS map_server keeps them."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np

from omninav.pipeline import (
    BadInput,
    Bounds,
    convert_fields,
    digest_file,
    digest_text,
    read_parameters,
    read_small,
    read_yaml,
    user_path,
)
from omninav.stages.geometry.arrays import Bools, Bytes, Ints
from omninav.stages.values.encoded_image import Undecodable, decode_image
from omninav.stages.values.floor_plan import FloorPlan
from omninav.stages.values.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid

MAX_CELLS = 25_000_000
"""Largest grid, cells: 250 m x 250 m in cells of 5 cm."""
Far = Annotated[float, Bounds(ge=-1e6, le=1e6)]
Share = Annotated[float, Bounds(ge=0, le=1)]


@dataclass(frozen=True)
class MapServer:
    """Keys read from a map_server file."""

    image: str
    resolution: Annotated[float, Bounds(ge=0.001, le=100)]
    """Metres."""
    origin: tuple[Far, Far, Far]
    """x, y (m) and turn (rad)."""
    occupied_thresh: Share = 0.65
    free_thresh: Share = 0.196
    negate: bool = False
    mode: Literal["trinary", "scale", "raw"] = "trinary"


def grid_beside(logs: str | Sequence[str] | None) -> Path | None:
    """The occupancy grid beside the first log that has one: `drive.grid/map.yaml` beside drive.mcap, or `map.yaml`."""
    for path in (user_path(log) for log in ((logs,) if isinstance(logs, str) else logs or ())):
        for grid in (path.parent / f"{path.stem}.grid" / "map.yaml", path.parent / "map.yaml"):
            if path.exists() and grid.is_file():
                return grid
    return None


def read_occupancy(file: Path) -> OccupancyGrid:
    """The grid in a map_server pair (`map.yaml`, which names its image). Raises BadInput where it cannot be read.

    Occupied is what is darker than `occupied_thresh` (lighter with `negate`), free what is lighter than
    `free_thresh`, and what is between is unknown, in the modes `trinary` and `scale`. In the mode `raw` levels are
    per cent, and those above 100 unknown. A turned origin is refused.
    """
    about = _described(file)
    if about.origin[2]:
        raise BadInput(f"{file}: its origin is turned by {about.origin[2]} rad, which is not supported")
    levels = _levels(file, about.image)
    filled = np.arange(256) / 255.0 if about.negate else 1.0 - np.arange(256) / 255.0
    if about.mode == "raw":
        filled = np.where(np.arange(256) > 100, np.nan, np.arange(256) / 100.0)
    states = np.full(256, UNKNOWN, np.uint8)
    states[filled > about.occupied_thresh] = OCCUPIED
    states[filled < about.free_thresh] = FREE
    return OccupancyGrid(states[levels[::-1]], about.resolution, (about.origin[0], about.origin[1]))


def grid_digest(file: Path) -> str:
    """The hash of a map_server pair that can be read."""
    return digest_text(digest_file(file), digest_file(file.parent / _described(file).image))


def _described(file: Path) -> MapServer:
    found, problems = convert_fields(_named(read_yaml(file), file), MapServer, "")
    if problems:
        what = f"{problems[0].where.lstrip('.')}: {problems[0].what}"
        raise BadInput(f"{file}: not a map_server map ({what}); give the .yaml beside a map's image")
    return MapServer(**found)


def _named(content: Any, file: Path) -> dict[str, Any]:
    """The keys of a map_server file that are read, with numbers that are written as 5e-2."""
    if not isinstance(content, dict):
        raise BadInput(f"{file}: not a map_server map; give the .yaml beside a map's image")
    known = {key: content[key] for key in read_parameters(MapServer) if content.get(key) is not None}
    for key in ("resolution", "occupied_thresh", "free_thresh"):
        if isinstance(known.get(key), str):
            with suppress(ValueError):
                known[key] = float(known[key])
    if known.get("negate") in (0, 1):
        known["negate"] = bool(known["negate"])
    return known


def _levels(file: Path, image: str) -> Bytes:
    """The grey levels of a grid's image."""
    try:
        return decode_image(read_small(file.parent / image, MAX_CELLS * 4), colour=False, max_pixels=MAX_CELLS)
    except BadInput as error:
        raise BadInput(f"{file}: its image {error}") from None
    except Undecodable as error:
        raise BadInput(f"{file}: its image {image:.100} cannot be read ({error}); expected PGM or PNG") from None


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
    """Occupied cells of a map_server pair, as boxes. Raises BadInput as `read_occupancy`."""
    grid = read_occupancy(file)
    rows, columns = grid.cells.shape
    cells, (x, y) = boxes(grid.cells == OCCUPIED), grid.origin
    corners = (cells[:, [[0, 1], [2, 1], [2, 3], [0, 3]]] * grid.resolution + (x, y)).astype(np.float64)
    return FloorPlan(corners, x + columns * grid.resolution, y + rows * grid.resolution)


def boxes(occupied: Bools) -> Ints:
    """Occupied cells (rows, columns) as few boxes: (B, 4) first column, first row, column and row after the last.

    Runs of a row that occur in the next row as well are one box.
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
