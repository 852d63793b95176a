"""Occupancy grid of a simulated world."""

import math
from typing import Annotated

import numpy as np

from omninav.pipeline import BadInput, Bounds, Context, Outputs, Stage
from omninav.stages.recordings.occupancy_grid import MAX_CELLS
from omninav.stages.values.grid import FREE, OCCUPIED, OccupancyGrid

from .config import WorldConfig
from .occupancy import occupancy
from .world import World


class WorldGrid(Stage):
    """Gives the occupancy grid of a simulated world on its first day. Raises BadInput where it has too many cells."""

    grid: str | None = None
    """The grid of another place, which takes its place."""
    log: str | tuple[str, ...] | None = None
    """A recorded log, which was not driven in the world."""
    world: WorldConfig = WorldConfig()
    """The simulated world."""
    resolution_m: Annotated[float, Bounds(gt=0)] = 0.1
    """Side of a cell."""

    class Out(Outputs):
        """`grid`: absent where another grid or a log is named."""

        grid: OccupancyGrid | None = None

    def step(self, ctx: Context) -> Out:
        if self.grid is not None or self.log is not None:
            return self.Out()
        world = World(self.world, 0)
        if math.prod(world.config.size) > MAX_CELLS * self.resolution_m**2:
            raise BadInput(f"grid: {self.world.name} has more than {MAX_CELLS:,} cells; use a larger resolution_m")
        cells, origin = occupancy(world, self.resolution_m)
        ctx.fact("grid", f"of the built-in world {self.world.name}")
        states = np.where(cells, OCCUPIED, FREE).astype(np.uint8)
        return self.Out(grid=OccupancyGrid(states, self.resolution_m, origin, "world"))
