"""Names of rooms, of a simulated world or of the log of a drive through one."""

import numpy as np

from omninav.pipeline import Context, Outputs, Stage
from omninav.stages.recordings.rooms_yaml import rooms_of_log
from omninav.stages.values.rooms import Rooms

from .config import WorldConfig
from .drawn_plan import laid_out


def rooms_of(world: WorldConfig) -> Rooms | None:
    """The rooms of a world; None where it has none."""
    world = laid_out(world)
    corners = [(*room.corner, room.corner[0] + room.size[0], room.corner[1] + room.size[1]) for room in world.rooms]
    return Rooms(tuple(room.name for room in world.rooms), np.array(corners, np.float64)) if corners else None


def known_rooms(log: str | tuple[str, ...] | None, world: WorldConfig) -> Rooms | None:
    """The rooms that are attached to the first of the logs that has any, or those of a world where no log is named."""
    if log is None:
        return rooms_of(world)
    return next(filter(None, map(rooms_of_log, (log,) if isinstance(log, str) else log)), None)


class WorldRooms(Stage):
    """Gives the named rooms of a simulated world, which can be goals of a robot."""

    log: str | tuple[str, ...] | None = None
    """A recorded log: its rooms are those that are attached to the first log that has any, as those of simulated drives
    have."""
    world: WorldConfig = WorldConfig()
    """The simulated world, where no log is named."""

    class Out(Outputs):
        """`rooms`: absent where nobody has named any."""

        rooms: Rooms | None = None

    def step(self, ctx: Context) -> Out:
        return self.Out(rooms=known_rooms(self.log, self.world))
