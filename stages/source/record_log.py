"""Writing a drive through a simulated world as a log, with its floor plan and grid beside it."""

from pathlib import Path
from typing import Annotated

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.pipeline.problems import BadInput
from omninav.stages.simulator.config import Event, WorldConfig
from omninav.stages.simulator.demo import DEMO
from omninav.stages.simulator.occupancy import write_grid
from omninav.stages.simulator.plan import draw_plan
from omninav.stages.simulator.world import World

from .camera_yaml import write_camera
from .simulated import SimulatedRecording
from .simulated_log import record


class RecordLog(Stage):
    """Writes one simulated drive: the log, and beside it camera.yaml, a floor plan and an occupancy grid.

    `log`: the .mcap file to write; the others are named after it. The same world, route, day
    and events give the same bytes.
    Raises `BadInput` where `log` is no .mcap name and `UnreadableRecording` for an unknown route.
    """

    world: WorldConfig = DEMO
    route: str = "drive"
    day: Annotated[int, Bounds(ge=0)] = 1
    log: str | None = None
    events: tuple[Event, ...] = ()

    class Out(Outputs):
        """Files are all it gives."""

    def step(self, ctx: Context) -> Out:
        """Render the whole drive and write it."""
        path = Path(self.log or "")
        if path.suffix != ".mcap":
            raise BadInput("simulate: name the log to write: log=out.mcap")
        recording = SimulatedRecording(self.world, self.route, self.day, self.events)
        record(recording, path)
        path.with_suffix(".camera.yaml").write_text(write_camera(recording.camera))
        world = World(self.world, self.day)
        draw_plan(world, path.with_suffix(".plan.png"), {self.route: recording.truth})
        grid = write_grid(world, path.parent / f"{path.stem}.grid")
        print(f"{path}: {len(recording.stamps)} pictures; floor plan, camera.yaml and {grid} beside it")
        return self.Out()
