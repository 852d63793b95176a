"""How a robot fared that drove by itself."""

from omninav.pipeline import Context, Metrics, Outputs, Quantity, Stage
from omninav.stages.values.drive import Drive

QUANTITIES = {
    "drive.collisions": Quantity(title="Collisions", better="lower"),
    "drive.distance_m": Quantity(title="Distance driven", context=True),
    "drive.duration_s": Quantity(title="Duration", context=True),
}


class DriveSummary(Stage):
    """Measures how long and how far a robot drove in a closed loop, and how often it touched something."""

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
        return self.Out(metrics=Metrics({"frames": len(drive), "drive": values}, QUANTITIES, ("drive.collisions",)))
