"""Keeps the views of all drives and the odometry between them."""

import math
from dataclasses import replace

import numpy as np

from omninav.pipeline import Context, Outputs, Stage
from omninav.stages.geometry.arrays import Array
from omninav.stages.values.belief import GaussianMixture
from omninav.stages.values.pose import Motion
from omninav.stages.values.sessions import Sessions
from omninav.stages.values.view_mixtures import ViewMixtures
from omninav.stages.values.views import WholeView

from .unimodality import unimodal_state

MAX_SIGMA_DEG = 45.0
"""Largest standard deviation of a believed heading, degrees; an unknown one has 104."""
MIN_MOVE_M = 0.01
"""Way between two views that are kept, metres."""


class KeyframeHistory(Stage):
    """Keeps each view, the odometry since the one before, and the pose that was believed.

    A map of views holds what its drives taught, and no more the drives themselves; with them it can be straightened
    (`StraightenSessions`) and learned again. Views of a robot that stands still are left out. A known map that was
    saved without its drives, as one of stated poses is, would be forgotten where it is learned again: with one none are
    kept. Manifest fact `map_straightened` records it.
    """

    class Out(Outputs):
        """All drives so far, those of a known map among them; absent where that has none."""

        sessions: Sessions | None = None

    def step(
        self,
        ctx: Context,
        view: WholeView,
        motion: Motion | None,
        state: GaussianMixture,
        kept: Sessions | None,
        known: ViewMixtures | None = None,
    ) -> Out:
        if kept is None:
            earlier = None if known is None else known.sessions
            if earlier is None or earlier.views.shape[1:] != view.rows.shape:
                if known is not None and len(known):
                    ctx.fact("map_straightened", "no: the map it continued was saved without its drives")
                    return self.Out()
                earlier = Sessions.empty(view)
            kept = replace(earlier, ticks=np.zeros(len(earlier), np.int64))  # the known map's own stay as they are
        begins = ctx.tick.first_of_log or motion is None
        if motion is not None:
            kept.move(np.array([motion.x, motion.y, motion.turn]))
        if begins or math.hypot(kept.since[0], kept.since[1]) >= MIN_MOVE_M:
            kept.keep(view, _believed(state), begins, ctx.tick.index)
        return self.Out(sessions=kept)


def _believed(state: GaussianMixture) -> Array | None:
    # The pose (3,) where the state has one mode and a heading.
    single = unimodal_state(state)
    return None if single is None or single[1][2, 2] > math.radians(MAX_SIGMA_DEG) ** 2 else single[0]
