"""The mixtures of the views that a tick changed: small enough to be kept, so that a reference's life can be told."""

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Context, Outputs, Stage, Value
from omninav.stages.values.view_mixtures import ViewEvent, ViewMixtures


class MixturesNow(Value):
    """Components of some views after a tick: `names` (C,) of their views, `means` (C, 3) m and rad, `weights` (C,)."""

    names: npt.NDArray[np.int64]
    means: npt.NDArray[np.float32]
    weights: npt.NDArray[np.float32]


class ChangedMixtures(Stage):
    """Keeps, of every view whose mixture a tick changed, all components as they are after it."""

    class Out(Outputs):
        """`mixtures`: absent where the tick changed nothing."""

        mixtures: MixturesNow | None = None

    def step(self, ctx: Context, map: ViewMixtures, events: ViewEvent | None) -> Out:
        """One tick; the map as it left it."""
        if events is None or not len(events.changed):
            return self.Out()
        mine = np.flatnonzero(np.isin(map.names[map.owner], events.changed))
        names = map.names[map.owner[mine]]
        means, weights = map.means[mine].astype(np.float32), map.weights[mine].astype(np.float32)
        return self.Out(mixtures=MixturesNow(names, means, weights))
