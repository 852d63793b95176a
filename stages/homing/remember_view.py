"""The place where a run began, as one to come back to."""

from typing import Annotated

from omninav.pipeline import Bounds, Context, Outputs, Stage, State, Tick
from omninav.stages.values.homing import ImagePath
from omninav.stages.values.local_features import LocalFeatures


class RememberViewState(State):
    """The first view, until it is given, and when it was seen (ns)."""

    views: tuple[LocalFeatures, ...] = ()
    stamp: int = 0


class RememberView(Stage):
    """A path of one picture, the first of the log: a robot that has been carried away from there can go back.

    Given once, `after` seconds, when the robot has been put elsewhere; who reads it holds it:
    `{from: remember.path, hold: true}`.
    """

    after: Annotated[float, Bounds(gt=0)] = 1.0

    class Out(Outputs):
        path: ImagePath | None = None

    def step(self, ctx: Context, kept: RememberViewState, tick: Tick, features: LocalFeatures) -> Out:
        """The path, once."""
        if tick.first_of_log:
            kept.views, kept.stamp = (features,), tick.stamp
        elif kept.views and tick.stamp - kept.stamp >= self.after * 1e9:
            path = ImagePath(tick.log, kept.views, ("the start",))
            kept.views = ()
            return self.Out(path=path)
        return self.Out()
