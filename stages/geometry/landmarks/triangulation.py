"""Points from the bearings of many images at known poses."""

import math
from typing import NamedTuple

import numpy as np

from omninav.pipeline.engine.compiled import compiled
from omninav.stages.geometry.arrays import Array, Bools, Ints
from omninav.stages.geometry.probability.small_systems import solve

ROUNDS = 4
"""Rounds of triangulating and of leaving out the bearings that miss the point by too much."""
MIN_VIEWS = 2
"""Least number of images that a point is triangulated from."""


class Triangulated(NamedTuple):
    """Points of tracks. `points` (T, 3), NaN where there is none; `kept` (O,): which sightings agree with them."""

    points: Array
    kept: Bools


def triangulated_tracks(
    starts: Ints, centres: Array, bearings: Array, miss: float, min_parallax: float, max_distance: float
) -> Triangulated:
    """Triangulate tracks; of track t the rows `starts[t]` to `starts[t + 1]` of the sightings.

    `centres` (O, 3): where each sighting was taken from (m), and `bearings` (O, 3) the unit vector it looks along, in
    the map frame. The least squares of the distances to the lines, each divided by the point's distance, so that angles
    are minimised. Sightings that are off by more than `miss` (rad) are dropped. A point needs two images and
    `min_parallax` (rad) between them, and is within `max_distance` (m) of all.
    """
    points = np.full((len(starts) - 1, 3), np.nan)
    kept = np.zeros(len(centres), np.bool_)
    _triangulate(starts, centres, bearings, math.cos(miss), min_parallax, max_distance, points, kept)
    return Triangulated(points, kept)


@compiled(nogil=True)
def _triangulate(
    starts: Ints,
    centres: Array,
    bearings: Array,
    min_cos: float,
    min_parallax: float,
    max_distance: float,
    points: Array,
    kept: Bools,
) -> None:
    weights = np.empty(len(centres))
    for t in range(len(starts) - 1):
        low, high = starts[t], starts[t + 1]
        kept[low:high] = True
        weights[low:high] = 1.0
        origin = centres[low]  # the map's own may be thousands of kilometres away
        point, views = np.empty(3), high - low
        for _ in range(ROUNDS):
            if views < MIN_VIEWS:
                break
            square, right = np.zeros((3, 3)), np.zeros(3)
            for o in range(low, high):
                if kept[o]:
                    for i in range(3):
                        for j in range(3):
                            part = weights[o] * ((1.0 if i == j else 0.0) - bearings[o, i] * bearings[o, j])
                            square[i, j] += part
                            right[i] += part * (centres[o, j] - origin[j])
            for i in range(3):
                square[i, i] += 1e-9
            point = solve(square, right) + origin
            views = 0
            for o in range(low, high):
                x, y, z = point[0] - centres[o, 0], point[1] - centres[o, 1], point[2] - centres[o, 2]
                length = math.sqrt(x * x + y * y + z * z)
                cos = x * bearings[o, 0] + y * bearings[o, 1] + z * bearings[o, 2]
                kept[o] = cos > min_cos * length and 0.0 < length < max_distance
                weights[o] = 1.0 / max(length * length, 1e-6)
                views += kept[o]
        widest = 1.0
        for a in range(low, high):
            for b in range(a + 1, high):
                if kept[a] and kept[b]:
                    cos = 0.0
                    for i in range(3):
                        cos += bearings[a, i] * bearings[b, i]
                    widest = min(widest, cos)
        if views >= MIN_VIEWS and math.acos(min(1.0, max(-1.0, widest))) > min_parallax:
            points[t] = point
        else:
            kept[low:high] = False
