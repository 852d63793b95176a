"""The floor plan of a simulated world as a value."""

from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.simulator.config import WorldConfig
from omninav.stages.simulator.demo import DEMO
from omninav.stages.simulator.world import World, outline
from omninav.stages.values.floor_plan import FloorPlan


class WorldPlan(Stage):
    """The plan of a simulated world on a day, for pictures of where a robot drove."""

    world: WorldConfig = DEMO
    day: Annotated[int, Bounds(ge=0)] = 1

    class Out(Outputs):
        plan: FloorPlan

    def step(self, ctx: Context) -> Out:
        """Outlines of everything that a robot cannot drive over or under."""
        outlines = np.array([outline(box) for box in World(self.world, self.day).obstacles]).reshape(-1, 4, 2)
        width, depth = self.world.size
        return self.Out(plan=FloorPlan(outlines, float(width), float(depth)))
