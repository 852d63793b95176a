"""Writing a drive through a simulated world as a log, with its floor plan and grid beside it."""

from pathlib import Path

from omninav.pipeline import Context, Outputs, Stage
from omninav.pipeline.problems import BadInput
from omninav.stages.simulator.config import Event, WorldConfig
from omninav.stages.simulator.demo import DEMO
from omninav.stages.simulator.occupancy import write_grid
from omninav.stages.simulator.plan import draw_plan
from omninav.stages.simulator.world import World

from .camera_yaml import write_camera
from .simulated import SimulatedRecording, in_order
from .simulated_log import record


class RecordLog(Stage):
    """Writes a simulated drive, or one on each of several days: a log, camera.yaml, a floor plan, an occupancy grid.

    `log`: the .mcap file to write; the others are named after it. Plan and grid are the first day's. The same world,
    route, days and events give the same bytes. Raises `BadInput` where `log` is no .mcap name and
    `UnreadableRecording` for an unknown route.
    """

    world: WorldConfig = DEMO
    route: str = "drive"
    day: int | tuple[int, ...] = 1
    log: str | None = None
    events: tuple[Event, ...] = ()

    class Out(Outputs):
        """Files are all it gives."""

    def step(self, ctx: Context) -> Out:
        """Render the whole drive and write it."""
        path = Path(self.log or "")
        if path.suffix != ".mcap":
            raise BadInput("simulate: name the log to write: log=out.mcap")
        days = in_order(self.day)
        drives = [SimulatedRecording(self.world, self.route, day, self.events) for day in days]
        record(drives, path)
        path.with_suffix(".camera.yaml").write_text(write_camera(drives[0].camera))
        world = World(self.world, days[0])
        driven = {f"{self.route}, day {drive.day}": drive.truth for drive in drives}
        draw_plan(world, path.with_suffix(".plan.png"), driven)
        grid = write_grid(world, path.parent / f"{path.stem}.grid")
        pictures = sum(len(drive.stamps) for drive in drives)
        collisions = sum(drive.collisions for drive in drives)
        ctx.fact("collisions", collisions)
        if collisions:
            print(f"{path}: on its way the robot came into contact with something {collisions} times")
        print(f"{path}: {pictures} pictures; floor plan, camera.yaml and {grid} beside it")
        return self.Out()
