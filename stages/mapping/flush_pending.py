"""Flushes pending map updates at the end of the last log."""

from collections.abc import Sequence

from omninav.pipeline import Context, Outputs, Stage, Tick
from omninav.stages.values.map_update import MapUpdates


class FlushPending(Stage):
    """Gives the updates that still wait after the last log.

    No tick tells that it is the last, so this stage runs after the loop: `ticks` is collected for that only. A second
    node of the map's class (`final_map`) applies the updates, and its map is saved.
    """

    class Out(Outputs):
        """The pending updates, in the order in which their views were seen."""

        updates: MapUpdates | None = None

    def step(self, ctx: Context, ticks: Sequence[Tick], waiting: MapUpdates | None = None) -> Out:
        return self.Out(updates=waiting)
