"""Bodies of a floor plan, turned over: with x and y exchanged, and mirrored."""

import math
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from .config import Block, Door, Point, Room, Shelf, Side, WallPanel

Body = TypeVar("Body", Block, Shelf)
OPPOSITE: dict[Side, Side] = {"east": "west", "west": "east", "north": "south", "south": "north"}
EXCHANGED: dict[Side, Side] = {"east": "north", "north": "east", "west": "south", "south": "west"}


@dataclass(frozen=True)
class Mirrored:
    """A way to turn a plan over: x and y exchanged first, then mirrored within the floor's `size` (m) of after."""

    size: Point
    exchanged: bool = False
    flips: tuple[bool, bool] = (False, False)
    """In x, in y."""

    def point(self, point: Point) -> Point:
        """Gives the place to which a point comes."""
        x, y = point[::-1] if self.exchanged else point
        return self.size[0] - x if self.flips[0] else x, self.size[1] - y if self.flips[1] else y

    def rectangle(self, corner: Point, size: Point) -> tuple[Point, Point]:
        """Lower left corner and size of a rectangle."""
        ends = np.array([self.point(corner), self.point((corner[0] + size[0], corner[1] + size[1]))])
        (x, y), (width, depth) = ends.min(axis=0).tolist(), np.ptp(ends, axis=0).tolist()
        return (max(round(x, 3), 0.0), max(round(y, 3), 0.0)), (round(width, 3), round(depth, 3))

    def side(self, side: Side) -> Side:
        """The side that a side becomes."""
        side = EXCHANGED[side] if self.exchanged else side
        return OPPOSITE[side] if self.flips[0 if side in ("east", "west") else 1] else side

    def heading(self, heading: float) -> float:
        """A direction (rad)."""
        x, y = math.cos(heading), math.sin(heading)
        x, y = (y, x) if self.exchanged else (x, y)
        return math.atan2(-y if self.flips[1] else y, -x if self.flips[0] else x)

    def room(self, room: Room) -> Room:
        """A room with its doors and windows."""
        corner, size = self.rectangle(room.corner, room.size)
        doors = tuple(self._door(door, room.size) for door in room.doors)
        return replace(room, corner=corner, size=size, doors=doors, windows=tuple(map(self.side, room.windows)))

    def _door(self, door: Door, size: Point) -> Door:
        side, along_x = self.side(door.side), door.side in ("north", "south")
        reverse = self.flips[0 if side in ("north", "south") else 1]
        extent = size[0] if along_x else size[1]
        return replace(door, side=side, at=round(extent - door.at if reverse else door.at, 3))

    def panel(self, panel: WallPanel) -> WallPanel:
        """A wall panel."""
        return replace(panel, centre=self.point(panel.centre), facing=self.heading(panel.facing))

    def body(self, body: Body) -> Body:
        """A box or a shelf on the floor."""
        return replace(body, centre=self.point(body.centre), yaw=self.heading(body.yaw))
