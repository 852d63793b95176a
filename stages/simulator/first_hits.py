"""Distances of a world's surfaces along rays in space, for metrics; slower than the range sensors' rays."""

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from omninav.pipeline.engine.compiled import compiled
from omninav.stages.geometry.arrays import Array

from .bodies import Box, box_array


def first_hits(boxes: Sequence[Box], ceiling: float, eye: npt.ArrayLike, directions: npt.ArrayLike) -> Array:
    """Metres (N,) from a point `eye` (3,) of the map along unit vectors (N, 3) to the floor, the ceiling or a body.

    Every ray is tested against every body, by slabs in the body's own frame. A body around the eye is left out.
    Infinite for a level ray that meets nothing.
    """
    rays = np.ascontiguousarray(np.asarray(directions, np.float64).reshape(-1, 3))
    return np.asarray(_hits(box_array(boxes), float(ceiling), np.asarray(eye, np.float64), rays))


@compiled(error_model="numpy")
def _hits(boxes: Array, ceiling: float, eye: Array, rays: Array) -> Array:
    nearest = np.full(len(rays), math.inf)
    for i in range(len(rays)):
        dx, dy, dz = rays[i, 0], rays[i, 1], rays[i, 2]
        if dz != 0.0:
            nearest[i] = (ceiling - eye[2]) / dz if dz > 0.0 else -eye[2] / dz
        for b in range(len(boxes)):
            cos, sin = boxes[b, 2], boxes[b, 3]
            x, y = eye[0] - boxes[b, 0], eye[1] - boxes[b, 1]
            enter, leave = _slab(cos * x + sin * y, cos * dx + sin * dy, -boxes[b, 4], boxes[b, 4], -math.inf, math.inf)
            if enter > leave or leave <= 0.0 or enter >= nearest[i]:
                continue
            enter, leave = _slab(cos * y - sin * x, cos * dy - sin * dx, -boxes[b, 5], boxes[b, 5], enter, leave)
            enter, leave = _slab(eye[2], dz, boxes[b, 6], boxes[b, 7], enter, leave)
            if 0.0 < enter <= leave and enter < nearest[i]:
                nearest[i] = enter
    return nearest


@compiled(error_model="numpy")
def _slab(at: float, along: float, low: float, high: float, enter: float, leave: float) -> tuple[float, float]:
    """Clip the interval from `enter` to `leave` of a ray to the slab between two planes."""
    if along == 0.0:
        return (enter, leave) if low <= at <= high else (math.inf, -math.inf)
    one, other = (low - at) / along, (high - at) / along
    return max(enter, min(one, other)), min(leave, max(one, other))
