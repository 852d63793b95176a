"""What a planner knows of the driving before there is any."""

from omninav.pipeline import Context, Outputs, Stage
from omninav.stages.values.homing import DrivingStatus, PathProgress


class BeforeDriving(Stage):
    """No status and no progress: what there was before the first tick."""

    class Out(Outputs):
        status: DrivingStatus | None = None
        progress: PathProgress | None = None

    def step(self, ctx: Context) -> Out:
        """Nothing."""
        return self.Out()
