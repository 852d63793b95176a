"""A limit that is given."""

from typing import Annotated

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.values.pose import Motion
from omninav.stages.values.view_mixtures import ViewMixtures
from omninav.stages.values.views import NoveltyThreshold, WholeView


class FixedThreshold(Stage):
    """A given distance between views, in their own unit. It needs nothing of what the others measure."""

    distance: Annotated[float, Bounds(gt=0)] = 100.0

    class Out(Outputs):
        """The limit."""

        threshold: NoveltyThreshold

    def step(
        self,
        ctx: Context,
        view: WholeView | None = None,
        motion: Motion | None = None,
        known: ViewMixtures | None = None,
    ) -> Out:
        """Give it."""
        return self.Out(threshold=NoveltyThreshold(self.distance))
