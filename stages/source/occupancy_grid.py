"""Occupancy grids as ROS map_server keeps them: what is occupied, as boxes."""

from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
import yaml

from omninav.pipeline.problems import BadInput
from omninav.stages.values.floor_plan import FloorPlan


def read_grid(file: Path) -> FloorPlan:
    """The plan in a map_server pair (`map.yaml`, which names its picture). Raises BadInput where it cannot be read.

    Occupied is what is darker than `occupied_thresh` says (lighter with `negate`); a turned origin is refused.
    """
    try:
        said = yaml.safe_load(file.read_text())
        resolution, (x, y, turn) = float(said["resolution"]), map(float, said["origin"])
        threshold, negate = float(said.get("occupied_thresh", 0.65)), bool(said.get("negate", 0))
        picture = file.parent / str(said["image"])
    except (OSError, ValueError, TypeError, KeyError, yaml.YAMLError) as error:
        raise BadInput(f"{file}: not a map_server map ({error})") from None
    levels = cv2.imread(str(picture), cv2.IMREAD_GRAYSCALE)
    if levels is None:
        raise BadInput(f"{file}: its picture {picture.name} cannot be read")
    if turn:
        raise BadInput(f"{file}: its origin is turned by {turn} rad, which is not supported")
    dark = levels / 255.0 if negate else 1.0 - levels / 255.0
    cells = boxes((dark > threshold)[::-1])
    corners = (cells[:, [[0, 1], [2, 1], [2, 3], [0, 3]]] * resolution + (x, y)).astype(np.float64)
    rows, columns = levels.shape
    return FloorPlan(corners, x + columns * resolution, y + rows * resolution)


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
