"""The place where a log began, as one to come back to."""

from omninav.pipeline import Context, Outputs, Stage, State, Tick
from omninav.stages.values.homing import ImagePath
from omninav.stages.values.local_features import LocalFeatures

DELAY_S = 1.0
"""Time after the first view at which the path is given, seconds: the robot has been put elsewhere."""


class FirstViewPathState(State):
    """The first view of a log, until the path is given, and when it was seen (ns)."""

    log: int = -1
    views: tuple[LocalFeatures, ...] = ()
    stamp: int = 0


class FirstViewPath(Stage):
    """Gives a path of one view, the log's first, for a robot that is carried away and has to return.

    The path is given once; its reader holds it: `{from: first_view.path, hold: true}`.
    """

    class Out(Outputs):
        path: ImagePath | None = None

    def step(self, ctx: Context, state: FirstViewPathState, tick: Tick, features: LocalFeatures) -> Out:
        """The path, once."""
        if tick.log != state.log:  # its first image may have been lost
            state.views, state.log, state.stamp = (features,), tick.log, tick.stamp
        elif state.views and tick.stamp - state.stamp >= DELAY_S * 1e9:
            path = ImagePath(tick.log, state.views, ("the start",))
            state.views = ()
            return self.Out(path=path)
        return self.Out()
