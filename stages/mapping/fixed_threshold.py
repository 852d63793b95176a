"""A given novelty threshold."""

from typing import Annotated

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.values.pose import Motion
from omninav.stages.values.view_mixtures import ViewMixtures
from omninav.stages.values.views import NoveltyThreshold, WholeView


class FixedThreshold(Stage):
    """Gives a fixed threshold."""

    distance: Annotated[float, Bounds(gt=0)] = 100.0
    """Distance between views at which a view is new, in the views' unit."""

    class Out(Outputs):
        threshold: NoveltyThreshold

    def step(
        self,
        ctx: Context,
        view: WholeView | None = None,
        motion: Motion | None = None,
        known: ViewMixtures | None = None,
    ) -> Out:
        return self.Out(threshold=NoveltyThreshold(self.distance))
