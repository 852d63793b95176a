"""Bodies as upright boxes with covered faces."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from omninav.stages.geometry.arrays import Array, Ints


@dataclass(frozen=True)
class Tiling:
    """How a face is covered: `tiles` (rows, columns) of textures, each `width` by `height` metres."""

    tiles: Ints
    width: float
    height: float


Coverings = tuple[Tiling, Tiling, Tiling, Tiling, Tiling, Tiling]
"""Of the faces -x, +x, -y, +y, bottom, top of a box, in its own frame."""


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
