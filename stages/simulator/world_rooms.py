"""The names of a simulated world's rooms, as a value."""

import numpy as np

from omninav.pipeline import Context, Outputs, Stage
from omninav.stages.values.rooms import Rooms

from .config import WorldConfig
from .demo import DEMO


class WorldRooms(Stage):
    """The rooms of a simulated world by their names, so that a robot can be told where to go.

    With a recorded `log` nothing is known of its place.
    """

    log: str | tuple[str, ...] | None = None
    world: WorldConfig = DEMO

    class Out(Outputs):
        """`rooms`: absent where the world has none, or a log is driven through."""

        rooms: Rooms | None = None

    def step(self, ctx: Context) -> Out:
        """Read the world's rooms."""
        if self.log is not None or not self.world.rooms:
            return self.Out()
        corners = [(*room.corner, room.corner[0] + room.size[0], room.corner[1] + room.size[1])
                   for room in self.world.rooms]  # fmt: skip
        return self.Out(rooms=Rooms(tuple(room.name for room in self.world.rooms), np.array(corners, np.float64)))
