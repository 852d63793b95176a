"""Ranges as the robot's middle has them, of a scanner that sits elsewhere."""

import math
from dataclasses import replace

import numpy as np

from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.values.scan import Scan

from .static_transforms import LEVEL

SURFACE_CELLS = 8
"""Largest distance between the cells of two neighbouring echoes of one surface: a wall that is nearer to the robot's
middle than to the scanner is spread over more cells than it has echoes."""


def placed_scan(scan: Scan, pose: Array | None) -> Scan:
    """A scan around a scanner, whose `pose` (4, 4) is that on its robot, as one around the robot's middle.

    A scan without a pose, or of a scanner that leans, stays as it is. A scanner beside the middle gives a ring of its
    own step from there: of several echoes in one direction the nearest; between neighbouring echoes that are close
    together is a surface, as far as the further one.
    """
    if pose is None or abs(pose[2, 2]) < LEVEL:
        return scan
    side = math.copysign(1.0, pose[2, 2])
    yaw = math.atan2(pose[1, 0], pose[0, 0])
    turned = replace(scan, first=yaw + side * scan.first, step=side * scan.step)
    beside = math.hypot(pose[0, 3], pose[1, 3])
    if beside == 0.0:
        return turned
    heard, azimuths, step = np.isfinite(scan.ranges), turned.azimuths(), abs(scan.step)
    ranges = np.where(heard, scan.ranges, scan.farthest)
    x, y = pose[:2, 3, None] + ranges * np.stack([np.cos(azimuths), np.sin(azimuths)])
    directions = azimuths + wrap(np.arctan2(y, x) - azimuths)
    first, circle = float(directions.min()), max(2, round(2.0 * math.pi / step))
    cells = np.rint((directions - first) / step).astype(np.int64)
    ring = np.full(min(max(2, int(cells.max()) + 1), circle), np.inf)
    distances = np.hypot(x, y)
    np.minimum.at(ring, cells[heard] % circle, distances[heard])
    apart, surface = np.diff(cells), np.maximum(distances[:-1], distances[1:])
    near = heard[:-1] & heard[1:] & (np.abs(apart) <= SURFACE_CELLS)
    for cell in range(1, SURFACE_CELLS):
        between = np.flatnonzero(near & (np.abs(apart) > cell))
        at = (cells[between] + cell * np.sign(apart[between])) % circle
        np.minimum.at(ring, at, surface[between])
    return Scan(ring, first, step, max(0.0, scan.nearest - beside), max(0.0, scan.farthest - beside))
