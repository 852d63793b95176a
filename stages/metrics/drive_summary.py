"""How a robot fared that drove by itself."""

from typing import Any

import numpy as np

from omninav.pipeline import Context, Metrics, Outputs, Quantity, Stage
from omninav.stages.values.drive import Drive

QUANTITIES = {
    "drive.collisions": Quantity(title="Collisions", better="lower"),
    "drive.distance_m": Quantity(title="Distance driven", context=True),
    "drive.duration_s": Quantity(title="Duration", context=True),
}


class DriveSummary(Stage):
    """Measures how long and how far a robot drove by itself, and in a simulated world how often it touched something.

    Of a real robot nobody tallies contacts, and the distance is that of its odometry.
    """

    class Out(Outputs):
        """`metrics`: the entry `drive` of metrics.json."""

        metrics: Metrics

    def step(self, ctx: Context, drive: Drive) -> Out:
        """The whole run at once."""
        values: dict[str, Any] = {"duration_s": float(drive.seconds[-1]) if len(drive) else 0.0}
        tallied = np.flatnonzero(np.isfinite(drive.distance))
        if len(tallied):
            last = tallied[-1]
            values |= {"collisions": int(drive.collisions[last]), "distance_m": float(drive.distance[last])}
        else:
            values["distance_m"] = float(np.nansum(np.hypot(drive.motion[:, 0], drive.motion[:, 1])))
        return self.Out(metrics=Metrics({"frames": len(drive), "drive": values}, QUANTITIES, ("drive.collisions",)))
