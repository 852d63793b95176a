"""Floor plans of a simulated world, or of the place where a log was recorded."""

import numpy as np

from omninav.pipeline import Context, Outputs, Stage
from omninav.stages.recordings.occupancy_grid import grid_beside, grid_digest, read_grid
from omninav.stages.values.floor_plan import FloorPlan

from .config import DayNumber, WorldConfig


class FloorPlanOfLog(Stage):
    """Gives the floor plan of recorded logs, for plots: the grid beside the first log that has one.

    Beside `drive.mcap` that is `drive.grid/map.yaml`, as `omninav simulate` writes it, or else `map.yaml`, in the
    format of ROS map_server and in the frame of the true poses. Without a log it is the simulated world's plan on the
    first day, if there is one.
    """

    log: str | tuple[str, ...] | None = None
    """The recorded logs."""
    world: WorldConfig | None = WorldConfig()
    """The simulated world, for runs without a log; null: a real place, of which there is no plan."""
    day: DayNumber | tuple[DayNumber, ...] = 1
    """Its days."""

    class Out(Outputs):
        """`plan`: absent where no log has a grid beside it, and of a real place without a log."""

        plan: FloorPlan | None = None

    def inputs_digest(self) -> str | None:
        """Hash of the grid file, if there is one."""
        grid = grid_beside(self.log)
        return None if grid is None else grid_digest(grid)

    def step(self, ctx: Context) -> Out:
        if self.log is None and self.world is not None:
            return self.Out(plan=plan_of(self.world, self.day if isinstance(self.day, int) else self.day[0]))
        grid = grid_beside(self.log)
        return self.Out(plan=None if grid is None else read_grid(grid))


def plan_of(world: WorldConfig, day: int) -> FloorPlan:
    """A simulated world's plan on a day."""
    from .world import World, outline  # slow to import, and not needed for recorded logs

    built = World(world, day)
    outlines = np.array([outline(box) for box in built.obstacles]).reshape(-1, 4, 2)
    width, depth = built.config.size
    return FloorPlan(outlines, float(width), float(depth))
