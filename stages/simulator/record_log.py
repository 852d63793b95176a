"""Writing a drive through a simulated world as a log, with its floor plan and grid beside it."""

from pathlib import Path

import numpy as np

from omninav.pipeline import Context, Outputs, Stage
from omninav.pipeline.graph.problems import BadInput, counted
from omninav.stages.recordings.camera_yaml import write_camera

from .config import Kidnapping, WorldConfig
from .occupancy import write_grid
from .plan_image import draw_plan
from .simulated_log import record
from .simulated_recording import SimulatedRecording, in_order
from .world import World


def metres(drive: SimulatedRecording) -> float:
    """Distance (m) that the robot drove, without being carried."""
    steps = np.hypot(*np.diff(drive.true_poses[:, :2], axis=0).T)
    return float(steps[np.diff(drive.true_times) > 1].sum())  # put down 1 ns after it was taken up


class RecordLog(Stage):
    """Writes a simulated drive, or one on each of several days: a log, camera.yaml, a floor plan, an occupancy grid.

    The same world, route, days and kidnappings give the same bytes. Raises `BadInput` if `log` is no .mcap name and
    `UnreadableRecording` for an unknown route.
    """

    world: WorldConfig = WorldConfig()
    """The simulated world."""
    route: str = "drive"
    """Name of a route of the world."""
    day: int | tuple[int, ...] = 1
    """Day, or several days, to drive on; floor plan and grid are those of the first."""
    log: str | None = None
    """The .mcap file to write; the other files are named after it."""
    kidnappings: tuple[Kidnapping, ...] = ()
    """Further ones besides those of the route."""

    class Out(Outputs):
        """Nothing: it writes files."""

    def step(self, ctx: Context) -> Out:
        """Render the whole drive and write it."""
        path = Path(self.log or "")
        if path.suffix != ".mcap":
            raise BadInput("simulate: name the log to write, an MCAP file: log=out.mcap")
        days = in_order(self.day)
        ctx.doing(f"building {self.world.name} and planning {self.route}")
        drives = [SimulatedRecording(self.world, self.route, day, self.kidnappings) for day in days]
        ctx.doing("rendering the first image (a minute if the renderer has to be compiled)")
        record(drives, path, progress=ctx.progress)
        camera, floor = path.with_suffix(".camera.yaml"), path.with_suffix(".plan.png")
        camera.write_text(write_camera(drives[0].camera), encoding="utf-8")
        world = World(self.world, days[0])
        driven = {f"{self.route}, day {drive.day}": drive.truth for drive in drives}
        draw_plan(world, floor, driven)
        grid = write_grid(world, path.parent / f"{path.stem}.grid")
        images = sum(len(drive.stamps) for drive in drives)
        collisions = sum(drive.collisions for drive in drives)
        people = [self.world.day(day).people for day in days]
        for name, value in (
            ("route", self.route),
            ("day", self.day),
            ("length_m", round(sum(metres(drive) for drive in drives), 1)),
            ("frames", images),
            ("people", people[0] if len(people) == 1 else people),
            ("collisions", collisions),
        ):
            ctx.fact(name, value)
        if collisions:
            print(f"{path}: the robot touched obstacles {counted(collisions, 'time')}")
        print(f"{path}: {counted(images, 'image')}; beside it {camera.name}, {floor.name} and {grid}")
        return self.Out()
