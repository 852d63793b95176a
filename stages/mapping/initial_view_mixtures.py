"""The map of views before the first drive."""

from omninav.pipeline import Context, Outputs, Stage
from omninav.stages.values.view_mixtures import ViewMixtures


class InitialViewMixtures(Stage):
    """The map to begin with: the known one, where there is one (`map=FILE`), else one with no view in it."""

    class Out(Outputs):
        """The map to learn on."""

        map: ViewMixtures

    def step(self, ctx: Context, known: ViewMixtures | None = None) -> Out:
        """Give the known map, or the empty one."""
        return self.Out(map=ViewMixtures.empty() if known is None else known)
