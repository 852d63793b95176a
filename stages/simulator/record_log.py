"""Writing a drive through a simulated world as a log, with its floor plan and grid beside it."""

from pathlib import Path

import numpy as np

from omninav.pipeline import Context, Outputs, Stage
from omninav.pipeline.graph.problems import BadInput
from omninav.stages.recordings.camera_yaml import write_camera

from .config import Kidnapping, WorldConfig
from .demo import DEMO
from .occupancy import write_grid
from .plan_image import draw_plan
from .simulated_log import record
from .simulated_recording import SimulatedRecording, in_order
from .world import World


def metres(drive: SimulatedRecording) -> float:
    """How far the robot truly drove (m); being carried elsewhere is no driving."""
    steps = np.hypot(*np.diff(drive.true_poses[:, :2], axis=0).T)
    return float(steps[np.diff(drive.true_times) > 1].sum())  # put down 1 ns after it was taken up


class RecordLog(Stage):
    """Writes a simulated drive, or one on each of several days: a log, camera.yaml, a floor plan, an occupancy grid.

    `log`: the .mcap file to write; the others are named after it. Plan and grid are the first day's. The same world,
    route, days and kidnappings give the same bytes. Raises `BadInput` where `log` is no .mcap name and
    `UnreadableRecording` for an unknown route.
    """

    world: WorldConfig = DEMO
    route: str = "drive"
    day: int | tuple[int, ...] = 1
    log: str | None = None
    kidnappings: tuple[Kidnapping, ...] = ()

    class Out(Outputs):
        """Files are all it gives."""

    def step(self, ctx: Context) -> Out:
        """Render the whole drive and write it."""
        path = Path(self.log or "")
        if path.suffix != ".mcap":
            raise BadInput("simulate: name the log to write: log=out.mcap")
        days = in_order(self.day)
        ctx.doing(f"building {self.world.name} and planning {self.route}")
        drives = [SimulatedRecording(self.world, self.route, day, self.kidnappings) for day in days]
        ctx.doing("the first picture (for a minute, where the renderer was never compiled before)")
        record(drives, path, progress=ctx.progress)
        path.with_suffix(".camera.yaml").write_text(write_camera(drives[0].camera))
        world = World(self.world, days[0])
        driven = {f"{self.route}, day {drive.day}": drive.truth for drive in drives}
        draw_plan(world, path.with_suffix(".plan.png"), driven)
        grid = write_grid(world, path.parent / f"{path.stem}.grid")
        pictures = sum(len(drive.stamps) for drive in drives)
        collisions = sum(drive.collisions for drive in drives)
        people = [self.world.day(day).people for day in days]
        for name, value in (
            ("route", self.route),
            ("day", self.day),
            ("length_m", round(sum(metres(drive) for drive in drives), 1)),
            ("frames", pictures),
            ("people", people[0] if len(people) == 1 else people),
            ("collisions", collisions),
        ):
            ctx.fact(name, value)
        if collisions:
            print(f"{path}: on its way the robot came into contact with something {collisions} times")
        print(f"{path}: {pictures} pictures; floor plan, camera.yaml and {grid} beside it")
        return self.Out()
