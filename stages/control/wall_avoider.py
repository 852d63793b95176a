"""Driving about without bumping into anything."""

import math
from dataclasses import field
from typing import Annotated

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Context, Outputs, Stage, State
from omninav.stages.values.command import Command
from omninav.stages.values.scan import Scan

from .clearance import free_ahead, roomier_side

F64 = npt.NDArray[np.float64]


def _no_ranges() -> F64:
    return np.zeros(0)


class WallAvoiderState(State):
    """Which way it turns away (1 left, -1 right, 0 undecided), and the ranges of the tick before."""

    side: int = 0
    ranges: F64 = field(default_factory=_no_ranges)


class WallAvoider(Stage):
    """Wanders: straight on where there is room, towards the roomier side where not, on the spot where there is none.

    It reads nothing but the ring of ranges. Speed is such that it can stop within what is free ahead. A
    reading counts as free where it had no echo twice. A robot that turns away keeps its side until there is room again.
    """

    speed: Annotated[float, Bounds(gt=0)] = 0.4
    turning: Annotated[float, Bounds(gt=0)] = 0.8
    radius: Annotated[float, Bounds(gt=0)] = 0.25
    margin: Annotated[float, Bounds(ge=0)] = 0.15
    """Room (m) that it keeps on all sides."""
    stop_at: Annotated[float, Bounds(gt=0)] = 0.25
    """Free way (m) at which it turns on the spot."""
    slow_at: Annotated[float, Bounds(gt=0)] = 1.2
    """Free way (m) at which it begins to turn away."""

    class Out(Outputs):
        command: Command

    def step(self, ctx: Context, scan: Scan, memory: WallAvoiderState) -> Out:
        """The command that this ring of ranges asks for."""
        heard = np.minimum(scan.ranges, scan.farthest)
        ranges = np.minimum(heard, memory.ranges) if len(memory.ranges) == len(heard) else heard
        memory.ranges = heard
        free = free_ahead(ranges, scan.azimuths(), self.radius, self.margin)
        roomier = roomier_side(ranges, scan.azimuths())
        room = (free - self.stop_at) / (self.slow_at - self.stop_at)
        speed, turning, memory.side = wandering(room, roomier, memory.side)
        return self.Out(command=Command(self.speed * speed, self.turning * turning))


def wandering(room: float, roomier: float, side: int) -> tuple[float, float, int]:
    """Shares of the greatest speed and turning with which to wander, and the side to which it turns away.

    `room`: the free way ahead, 0 where it must stop, 1 where it need not turn yet. `roomier`: see `roomier_side`.
    `side`: the one of the tick before, 1 left, -1 right, 0 undecided.
    """
    if room > 1.0:
        return 1.0, 0.5 * math.tanh(roomier), 0
    side = side or (1 if roomier >= 0.0 else -1)
    share = max(0.0, room)
    return share, side * (1.0 - 0.5 * share), side
