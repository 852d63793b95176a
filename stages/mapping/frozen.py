"""A map of views that is used and not changed."""

from omninav.pipeline import Context, Outputs, Stage
from omninav.stages.values.map_update import MapUpdates
from omninav.stages.values.view_mixtures import ViewEvent, ViewMixtures
from omninav.stages.values.views import NoveltyThreshold


class Frozen(Stage):
    """The map as it came: the robot localises with it and learns nothing (`mapping=frozen map=FILE`)."""

    class Out(Outputs):
        """The map, unchanged, and nothing that was done to it."""

        map: ViewMixtures
        events: ViewEvent | None = None

    def step(
        self,
        ctx: Context,
        map: ViewMixtures,
        updates: MapUpdates | None = None,
        threshold: NoveltyThreshold | None = None,
    ) -> Out:
        """Hand the map on."""
        return self.Out(map=map)
