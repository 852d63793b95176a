"""A map of views that does not change."""

from omninav.pipeline import Context, Outputs, Stage
from omninav.stages.values.map_update import MapUpdates
from omninav.stages.values.view_mixtures import ViewEvent, ViewMixtures
from omninav.stages.values.views import NoveltyThreshold


class Frozen(Stage):
    """Passes the map on unchanged, for localisation only (`mapping=frozen map=FILE`)."""

    class Out(Outputs):
        map: ViewMixtures
        events: ViewEvent | None = None

    def step(
        self,
        ctx: Context,
        map: ViewMixtures,
        updates: MapUpdates | None = None,
        threshold: NoveltyThreshold | None = None,
    ) -> Out:
        return self.Out(map=map)
