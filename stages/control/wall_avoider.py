"""Wandering without touching anything."""

import math
from dataclasses import field
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage, State
from omninav.stages.geometry.arrays import Array
from omninav.stages.values.command import Command
from omninav.stages.values.scan import Scan

from .clearance import free_ahead, roomier_side, stopping_speed


class WallAvoiderState(State):
    """Which way it turns away (1 left, -1 right, 0 undecided), and the ranges of the tick before."""

    side: int = 0
    ranges: Array = field(default_factory=lambda: np.zeros(0))


class WallAvoider(Stage):
    """Drives straight on where there is room, else turns towards the side that has more, on the spot before a wall.

    It reads the ring of ranges alone. Its speed lets it stop within what is free ahead. A range counts as free where
    there was no echo twice. A robot that turns away keeps its side until there is room again.
    """

    max_speed: Annotated[float, Bounds(gt=0)] = 0.4
    """m/s."""
    max_angular_speed: Annotated[float, Bounds(gt=0)] = 0.8
    """rad/s."""
    deceleration: Annotated[float, Bounds(gt=0)] = 0.5
    """m/s^2, with which it brakes."""
    robot_radius_m: Annotated[float, Bounds(gt=0)] = 0.25
    """Radius of the robot's body."""
    margin_m: Annotated[float, Bounds(ge=0)] = 0.15
    """Room that the robot keeps on all sides."""
    stop_distance_m: Annotated[float, Bounds(gt=0)] = 0.25
    """Free distance at which the robot turns on the spot."""
    slow_distance_m: Annotated[float, Bounds(gt=0)] = 1.2
    """Free distance at which the robot begins to turn away."""

    class Out(Outputs):
        command: Command

    def step(self, ctx: Context, scan: Scan, state: WallAvoiderState) -> Out:
        present = np.minimum(scan.ranges, scan.farthest)
        ranges = np.minimum(present, state.ranges) if len(state.ranges) == len(present) else present
        state.ranges = present
        free = free_ahead(ranges, scan.azimuths(), self.robot_radius_m, self.margin_m)
        room = (free - self.stop_distance_m) / (self.slow_distance_m - self.stop_distance_m)
        speed, turning, state.side = wandering(room, roomier_side(ranges, scan.azimuths()), state.side)
        speed = min(self.max_speed * speed, stopping_speed(free - self.stop_distance_m, self.deceleration))
        return self.Out(command=Command(speed, self.max_angular_speed * turning))


def wandering(room: float, roomier: float, side: int) -> tuple[float, float, int]:
    """Shares of the largest speed and angular speed with which to wander, and the side to which the robot turns away.

    `room`: the free distance ahead, 0 where it must stop, 1 where it need not turn yet. `roomier`: see `roomier_side`.
    `side`: that of the tick before, 1 left, -1 right, 0 undecided.
    """
    if room > 1.0:
        return 1.0, 0.5 * math.tanh(roomier), 0
    side = side or (1 if roomier >= 0.0 else -1)
    share = max(0.0, room)
    return share, side * (1.0 - 0.5 * share), side
