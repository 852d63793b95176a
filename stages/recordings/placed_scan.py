"""Ranges as the robot's middle has them, of a scanner that sits elsewhere."""

import math
from dataclasses import replace

import numpy as np

from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.values.scan import Scan

from .static_transforms import LEVEL


def placed_scan(scan: Scan, pose: Array | None) -> Scan:
    """A scan around a scanner, whose `pose` (4, 4) is that on its robot, as one around the robot's middle.

    A scan without a pose, or of a scanner that leans, stays as it is. A scanner beside the middle gives a ring of its
    own step from there: of several echoes in one direction the nearest, and a single hole between two is closed.
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
    np.minimum.at(ring, cells[heard] % circle, np.hypot(x, y)[heard])
    around = np.pad(ring, 1, constant_values=np.inf)
    ring = np.where(np.isfinite(ring), ring, np.maximum(around[:-2], around[2:]))
    return Scan(ring, first, step, max(0.0, scan.nearest - beside), max(0.0, scan.farthest - beside))
