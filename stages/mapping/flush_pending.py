"""What still waits to be learned as the last log ends."""

from collections.abc import Sequence

from omninav.pipeline import Context, Outputs, Stage, Tick
from omninav.stages.values.map_update import MapUpdates


class FlushPending(Stage):
    """Gives out, once the last log has ended, the lessons that would have waited for the next one.

    No tick tells that it is the last. So this stage runs after the loop, which is all that `ticks` is collected for; a
    second node of the map's own class learns from what it gives (`last_map`), and that map is the one to save.
    """

    class Out(Outputs):
        """What is left, in the order in which it was seen."""

        updates: MapUpdates | None = None

    def step(self, ctx: Context, ticks: Sequence[Tick], waiting: MapUpdates | None = None) -> Out:
        """Give it all out."""
        return self.Out(updates=waiting)
