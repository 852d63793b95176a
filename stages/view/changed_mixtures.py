"""The mixtures of the views that a tick changed: small enough to be kept, so that a reference's life can be told."""

import numpy as np

from omninav.pipeline import Context, Outputs, Stage
from omninav.stages.values.lesson import Lessons
from omninav.stages.values.view_mixtures import MixturesNow, ViewEvent, ViewMixtures


class ChangedMixtures(Stage):
    """Keeps, of every view whose mixture a tick changed, all components as they are after it.

    With `lessons` it also says when what came had been seen, where that is learned late.
    """

    class Out(Outputs):
        """`mixtures`: absent where the tick changed nothing."""

        mixtures: MixturesNow | None = None

    def step(self, ctx: Context, map: ViewMixtures, events: ViewEvent | None, lessons: Lessons | None = None) -> Out:
        """One tick; the map as it left it."""
        if events is None or not len(events.changed):
            return self.Out()
        mine = np.flatnonzero(np.isin(map.names[map.owner], events.changed))
        names = map.names[map.owner[mine]]
        means, weights = map.means[mine].astype(np.float32), map.weights[mine].astype(np.float32)
        came = np.flatnonzero(np.isin(map.names, events.inserted))
        indices = np.array([lesson.index for lesson in lessons.items] if lessons else [], np.int64)
        if len(indices):  # a view's `born` counts the lessons before the one it came with
            number = np.clip(map.born[came] - (map.steps - len(indices)), 0, len(indices) - 1)
            seen = indices[number]
        else:
            seen = np.full(len(came), ctx.tick.index if len(came) else 0, np.int64)
        return self.Out(mixtures=MixturesNow(names, means, weights, map.names[came], seen))
