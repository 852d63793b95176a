"""What is known of the way and the driving before there is any."""

from omninav.pipeline import Context, Outputs, Stage
from omninav.stages.values.homing import DrivingStatus, PathProgress
from omninav.stages.values.planned_route import PlannedRoute


class BeforeDriving(Stage):
    """No way, no status and no progress: what there was before the first tick."""

    class Out(Outputs):
        status: DrivingStatus | None = None
        progress: PathProgress | None = None
        route: PlannedRoute | None = None

    def step(self, ctx: Context) -> Out:
        """Nothing."""
        return self.Out()
