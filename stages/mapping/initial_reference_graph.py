"""The map before the drive."""

from omninav.pipeline import Context, Outputs, Stage
from omninav.stages.values.maps import ReferenceGraph


class InitialReferenceGraph(Stage):
    """A reference graph with no reference in it: what a mapping drive begins with."""

    class Out(Outputs):
        """The map to grow."""

        map: ReferenceGraph

    def step(self, ctx: Context) -> Out:
        """Give the empty map."""
        return self.Out(map=ReferenceGraph.empty())
