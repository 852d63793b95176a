"""Bodies as upright boxes with covered faces, and by the cells of a grid."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from omninav.stages.geometry.arrays import Array, Ints, Shorts


@dataclass(frozen=True)
class Tiling:
    """Covering of a face: `tiles` (rows, columns) of textures, each `width` by `height` metres."""

    tiles: Ints
    width: float
    height: float


Coverings = tuple[Tiling, Tiling, Tiling, Tiling, Tiling, Tiling]
"""Coverings of the faces -x, +x, -y, +y, bottom, top of a box, in its own frame."""


@dataclass(frozen=True)
class Box:
    """A body: what it is, centre, half length and half depth, yaw, lower and upper z, and its faces' coverings."""

    kind: str
    centre: tuple[float, float]
    half: tuple[float, float]
    yaw: float
    low: float
    high: float
    faces: Coverings


def box_array(boxes: Sequence[Box]) -> Array:
    """Boxes (B, 9): centre x, y, cosine, sine of the yaw, half length, half depth, lower, upper z, squared radius."""
    rows = [
        (*b.centre, math.cos(b.yaw), math.sin(b.yaw), *b.half, b.low, b.high, b.half[0] ** 2 + b.half[1] ** 2)
        for b in boxes
    ]
    return np.array(rows, dtype=np.float64).reshape(-1, 9)


def boxes_of_cells(
    boxes: Array, reach: float, corner: Array, size: float, rows: int, columns: int
) -> tuple[Shorts, Shorts]:
    """Boxes (B, >= 6) within `reach` m of each cell of a grid, by their bounding rectangles.

    `corner` (2,): of the first cell, of `size` m. Returns where those of each cell begin (cells + 1,), and their
    numbers, ascending in each. Boxes beyond the grid are those of its outer cells.
    """
    cos, sin = np.abs(boxes[:, 2]), np.abs(boxes[:, 3])
    extent = np.stack([cos * boxes[:, 4] + sin * boxes[:, 5], sin * boxes[:, 4] + cos * boxes[:, 5]], axis=1) + reach
    low = np.floor((boxes[:, :2] - extent - corner) / size - 1e-9)
    high = np.floor((boxes[:, :2] + extent - corner) / size + 1e-9)
    first, last = (np.clip(ends, 0, [columns - 1, rows - 1]).astype(np.int64).tolist() for ends in (low, high))
    noted = [
        np.add.outer(columns * np.arange(bottom, top + 1), np.arange(left, right + 1)).ravel()
        for (left, bottom), (right, top) in zip(first, last, strict=True)
    ]
    cells = np.concatenate([np.zeros(0, np.int64), *noted])
    numbers = np.repeat(np.arange(len(noted), dtype=np.int32), [len(each) for each in noted])
    order = np.argsort(cells, kind="stable")
    return np.searchsorted(cells[order], np.arange(rows * columns + 1)).astype(np.int32), numbers[order]
