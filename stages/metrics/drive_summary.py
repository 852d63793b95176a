"""How a robot fared that drove by itself."""

from collections.abc import Sequence

from omninav.pipeline import Context, Outputs, Stage, Tick
from omninav.pipeline.graph.results import Metrics
from omninav.stages.values.drive_tally import DriveTally


class DriveSummary(Stage):
    """How long and how far a robot drove in a closed loop, and how often it came into contact with something."""

    class Out(Outputs):
        """`metrics`: the entry `drive` of metrics.json."""

        metrics: Metrics

    def step(self, ctx: Context, ticks: Sequence[Tick], tallies: Sequence[DriveTally]) -> Out:
        """The whole run at once."""
        seconds = (ticks[-1].stamp - ticks[0].stamp) / 1e9 if len(ticks) else 0.0
        distance, collisions = (tallies[-1].distance, tallies[-1].collisions) if len(tallies) else (0.0, 0)
        drive = {
            "collisions": collisions,
            "distance_m": distance,
            "duration_s": seconds,
        }
        return self.Out(metrics=Metrics({"frames": len(ticks), "drive": drive}))
