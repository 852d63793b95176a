"""Keeps the mixtures of the views that a tick changed, so that a reference's history can be plotted."""

import numpy as np

from omninav.pipeline import Context, Outputs, Stage
from omninav.stages.values.view_mixtures import MixturesNow, ViewEvent, ViewMixtures


class ChangedMixtures(Stage):
    """Keeps all components of every view whose mixture changed in a tick."""

    class Out(Outputs):
        """`mixtures`: absent where the tick changed nothing."""

        mixtures: MixturesNow | None = None

    def step(self, ctx: Context, map: ViewMixtures, events: ViewEvent | None) -> Out:
        """One tick; the map as it left it."""
        if events is None or not len(events.changed):
            return self.Out()
        mine = np.flatnonzero(np.isin(map.ids[map.owner], events.changed))
        names = map.ids[map.owner[mine]]
        means, weights = map.means[mine].astype(np.float32), map.weights[mine].astype(np.float32)
        return self.Out(mixtures=MixturesNow(names, means, weights))
