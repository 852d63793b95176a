"""The map of views before the first drive."""

from omninav.pipeline import Context, Outputs, Stage
from omninav.stages.values.view_mixtures import ViewMixtures


class InitialViewMixtures(Stage):
    """Gives the map to begin with: a saved one (`map=FILE`), or an empty one."""

    class Out(Outputs):
        map: ViewMixtures

    def step(self, ctx: Context, known: ViewMixtures | None = None) -> Out:
        """Give the known map, or the empty one."""
        return self.Out(map=ViewMixtures.empty() if known is None else known)
