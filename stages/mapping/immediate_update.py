"""Updates the map with each view at once."""

from omninav.pipeline import Context, Outputs, Stage
from omninav.stages.values.belief import GaussianMixture
from omninav.stages.values.map_update import MapUpdate, MapUpdates
from omninav.stages.values.pose import UncertainMotion
from omninav.stages.values.views import WholeView


class ImmediateUpdate(Stage):
    """Gives an update with each view and the whole current state, whatever its number of modes.

    Porta & Kroese 2004, section 3.2. A state without components gives no update.
    """

    class Out(Outputs):
        """One update or none; none waits."""

        updates: MapUpdates
        waiting: MapUpdates | None = None

    def step(self, ctx: Context, view: WholeView, state: GaussianMixture, model: UncertainMotion | None = None) -> Out:
        """Make the update."""
        items = (MapUpdate(view, state, ctx.tick.index),) if len(state) else ()
        return self.Out(updates=MapUpdates(items))
