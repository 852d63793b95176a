"""A world's occupancy grid and floor plan as files."""

import math
from pathlib import Path

import numpy as np

from omninav.pipeline import write_whole
from omninav.stages.geometry.arrays import Bools

from .world import World

FREE, OCCUPIED = 254, 0
"""Grey levels that map_server writes."""


def occupancy(world: World, resolution: float = 0.05) -> tuple[Bools, tuple[float, float]]:
    """Occupied cells (rows, columns), row 0 at the lowest y, and the map position (m) of the grid's lower left corner.

    A cell is occupied where an obstacle comes closer to its centre than half a cell.
    """
    margin = 2 * resolution
    columns = math.ceil((world.config.size[0] + 2 * margin) / resolution)
    rows = math.ceil((world.config.size[1] + 2 * margin) / resolution)
    x = -margin + resolution * (np.arange(columns) + 0.5)
    y = -margin + resolution * (np.arange(rows) + 0.5)
    points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    return (world.clearance(points) < resolution / 2).reshape(rows, columns), (-margin, -margin)


def write_grid(world: World, folder: Path, resolution: float = 0.05) -> Path:
    """Write `map.pgm` and `map.yaml` (ROS map_server) into a folder; returns the path of the YAML file."""
    cells, origin = occupancy(world, resolution)
    levels = np.where(cells[::-1], OCCUPIED, FREE).astype(np.uint8)
    rows, columns = levels.shape
    write_whole(folder / "map.pgm", f"P5\n{columns} {rows}\n255\n".encode() + levels.tobytes())
    lines = [
        "image: map.pgm",
        "mode: trinary",
        f"resolution: {resolution:g}",
        f"origin: [{origin[0]:g}, {origin[1]:g}, 0.0]",
        "negate: 0",
        "occupied_thresh: 0.65",
        "free_thresh: 0.196",
    ]
    write_whole(folder / "map.yaml", "\n".join(lines) + "\n")
    return folder / "map.yaml"
