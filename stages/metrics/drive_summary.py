"""How a robot fared that drove by itself."""

from omninav.pipeline import Context, Outputs, Stage
from omninav.pipeline.graph.results import Metrics
from omninav.stages.values.drive import Drive


class DriveSummary(Stage):
    """How long and how far a robot drove in a closed loop, and how often it came into contact with something."""

    class Out(Outputs):
        """`metrics`: the entry `drive` of metrics.json."""

        metrics: Metrics

    def step(self, ctx: Context, drive: Drive) -> Out:
        """The whole run at once."""
        values = {
            "collisions": int(drive.collisions[-1]) if len(drive) else 0,
            "distance_m": float(drive.distance[-1]) if len(drive) else 0.0,
            "duration_s": float(drive.seconds[-1]) if len(drive) else 0.0,
        }
        return self.Out(metrics=Metrics({"frames": len(drive), "drive": values}))
