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


def boxes_of_cells(low: Ints, high: Ints, rows: int, columns: int) -> tuple[Shorts, Shorts]:
    """Boxes by the cells of a grid: where those of each cell begin (cells + 1,), and their numbers, ascending in each.

    `low` and `high` (B, 2): first and last column, and row, that each box is noted in.
    """
    noted = [
        np.add.outer(columns * np.arange(bottom, top + 1), np.arange(left, right + 1)).ravel()
        for (left, bottom), (right, top) in zip(low.tolist(), high.tolist(), strict=True)
    ]
    cells = np.concatenate([np.zeros(0, np.int64), *noted])
    boxes = np.repeat(np.arange(len(noted), dtype=np.int32), [len(each) for each in noted])
    order = np.argsort(cells, kind="stable")
    return np.searchsorted(cells[order], np.arange(rows * columns + 1)).astype(np.int32), boxes[order]
