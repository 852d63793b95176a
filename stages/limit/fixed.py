"""A limit that is given."""

from typing import Annotated

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.values.views import ViewLimit


class FixedLimit(Stage):
    """A given distance between views, in their own unit."""

    distance: Annotated[float, Bounds(gt=0)] = 100.0

    class Out(Outputs):
        """The limit."""

        limit: ViewLimit

    def step(self, ctx: Context) -> Out:
        """Give it."""
        return self.Out(limit=ViewLimit(self.distance))
