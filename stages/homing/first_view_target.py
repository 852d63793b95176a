"""The first view of a log as the target of every other view, for homing from two views alone."""

from omninav.pipeline import Context, Outputs, Stage, State, Tick
from omninav.stages.values.homing import HomingTarget
from omninav.stages.values.local_features import LocalFeatures


class FirstViewTargetState(State):
    """The first view of a log."""

    log: int = -1
    views: tuple[LocalFeatures, ...] = ()


class FirstViewTarget(Stage):
    """Gives the log's first view as a new target at each tick.

    For a new target homing makes a new local map, so that its vector is that of two views alone (Goedemé et al. 2007,
    section 7.1).
    """

    class Out(Outputs):
        """Absent at the first view itself. `features`: the target's, to match with."""

        target: HomingTarget | None = None
        features: LocalFeatures | None = None

    def step(self, ctx: Context, state: FirstViewTargetState, tick: Tick, features: LocalFeatures) -> Out:
        if tick.log != state.log:  # the image of its first tick may have been lost
            state.log, state.views = tick.log, (features,)
            return self.Out()
        return self.Out(target=HomingTarget(tick.index, state.views[0]), features=state.views[0])
