"""Names of a simulated world's rooms."""

import numpy as np

from omninav.pipeline import Context, Outputs, Stage
from omninav.stages.values.rooms import Rooms

from .config import WorldConfig
from .demo import DEMO


class WorldRooms(Stage):
    """Gives the named rooms of a simulated world, which can be goals of a robot."""

    log: str | tuple[str, ...] | None = None
    """A recorded log: then nothing is known of the place and the output is absent."""
    world: WorldConfig = DEMO
    """The simulated world."""

    class Out(Outputs):
        """`rooms`: absent if the world has none, and with a recorded log."""

        rooms: Rooms | None = None

    def step(self, ctx: Context) -> Out:
        """Read the world's rooms."""
        if self.log is not None or not self.world.rooms:
            return self.Out()
        corners = [(*room.corner, room.corner[0] + room.size[0], room.corner[1] + room.size[1])
                   for room in self.world.rooms]  # fmt: skip
        return self.Out(rooms=Rooms(tuple(room.name for room in self.world.rooms), np.array(corners, np.float64)))
