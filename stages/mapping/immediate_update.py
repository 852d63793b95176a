"""Every view is learned from at once, with the state that is believed now."""

from omninav.pipeline import Context, Outputs, Stage
from omninav.stages.values.belief import GaussianMixture
from omninav.stages.values.map_update import MapUpdate, MapUpdates
from omninav.stages.values.pose import UncertainMotion
from omninav.stages.values.view_mixtures import ViewMixtures
from omninav.stages.values.views import Neighbours, WholeView


class ImmediateUpdate(Stage):
    """Each view is a lesson in the tick in which it is seen, with the whole state, however many modes it has.

    Porta & Kroese 2004, section 3.2. A state without any component teaches nothing.
    """

    class Out(Outputs):
        """What this tick has to teach: one lesson, or none. Nothing waits."""

        updates: MapUpdates
        waiting: MapUpdates | None = None

    def step(
        self,
        ctx: Context,
        view: WholeView,
        state: GaussianMixture,
        model: UncertainMotion | None = None,
        neighbours: Neighbours | None = None,
        map: ViewMixtures | None = None,
    ) -> Out:
        """Make a lesson of the view."""
        items = (MapUpdate(view, state, ctx.tick.index),) if len(state) else ()
        return self.Out(updates=MapUpdates(items))
