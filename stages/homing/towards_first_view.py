"""The first view of a log as a target that is new at every tick: what homing makes of two views, without tracking."""

from omninav.pipeline import Context, Outputs, Stage, State, Tick
from omninav.stages.values.homing import HomingTarget
from omninav.stages.values.local_features import LocalFeatures


class TowardsFirstViewState(State):
    """The first view."""

    views: tuple[LocalFeatures, ...] = ()


class TowardsFirstView(Stage):
    """At every tick but a log's first a target of its own, the log's first view.

    A target that is another each time has homing begin anew: its vector is that of two views alone (Goedemé et al.
    2007, section 7.1).
    """

    class Out(Outputs):
        """Absent at the first view itself. `features`: the target's, to match with."""

        target: HomingTarget | None = None
        features: LocalFeatures | None = None

    def step(self, ctx: Context, first: TowardsFirstViewState, tick: Tick, features: LocalFeatures) -> Out:
        """The target of this tick."""
        if tick.first_of_log:
            first.views = (features,)
            return self.Out()
        return self.Out(target=HomingTarget(tick.index, first.views[0]), features=first.views[0])
