"""Writes a drive through a simulated world as a log."""

from omninav.pipeline import BadInput, Context, Tool, user_path
from omninav.stages.simulator.config import DayNumber, Kidnapping, WorldConfig
from omninav.stages.simulator.record_log import record_log


class Simulate(Tool):
    """Writes a simulated drive as a log; beside it camera.yaml, a floor plan and an occupancy grid.

    Raises BadInput if `log` is no .mcap name, and for an unknown route.
    """

    example = "route=tour day=0 log=tour.mcap"
    groups = ("world", "world_camera")

    log: str
    """The .mcap file to write; the other files are named after it."""
    world: WorldConfig
    """The simulated world."""
    route: str = "drive"
    """Name of a route of the world."""
    day: DayNumber | tuple[DayNumber, ...] = 1
    """Day, or several days, to drive on; floor plan and grid are those of the first."""
    kidnappings: tuple[Kidnapping, ...] = ()
    """Further ones besides those of the route."""

    def run(self, ctx: Context) -> None:
        path = user_path(self.log)
        if path.suffix != ".mcap":
            raise BadInput("simulate: name the log to write, an MCAP file: log=out.mcap")
        record_log(path, self.world, self.route, self.day, self.kidnappings, ctx)
