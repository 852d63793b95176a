"""Places that a robot can get to on a listed floor plan, found before anything of it is built."""

import math

import cv2
import numpy as np

from omninav.stages.geometry.arrays import Array

from .config import Room, WorldConfig
from .layout import expand
from .obstacles import distances, gather

CELL_M = 0.1
ROOM_M = 0.15
"""Metres between the robot's body and everything at such a place, so that furniture may move a little."""
DRIVEN_UNDER_M = 1.4
"""Least height (m) of the underside of bodies that are in nobody's way."""


def standing_room(world: WorldConfig) -> Array:
    """Places (N, 2) on a grid of 0.1 m with room for the robot on day 0, all connected."""
    blocks = [block for block in expand(world).blocks if block.bottom_z < DRIVEN_UNDER_M]
    boxes = [(*b.centre, math.cos(b.yaw), math.sin(b.yaw), b.size[0] / 2, b.size[1] / 2) for b in blocks]
    columns, rows = (math.floor(extent / CELL_M) for extent in world.size)
    x, y = CELL_M * (np.arange(columns) + 0.5), CELL_M * (np.arange(rows) + 0.5)
    points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    free = distances(gather(np.reshape(boxes, (-1, 6)), world.size, 1.0), points) > world.robot.radius + ROOM_M
    _, parts = cv2.connectedComponents(free.reshape(rows, columns).astype(np.uint8), connectivity=8)
    sizes = np.bincount(parts.ravel())
    sizes[0] = 0
    reached: Array = points[parts.ravel() == sizes.argmax()]
    return reached


def within(places: Array, room: Room) -> Array:
    """Those of the places (N, 2) that are in a room."""
    low, high = np.array(room.corner), np.add(room.corner, room.size)
    inside: Array = places[((places > low) & (places < high)).all(axis=1)]
    return inside
