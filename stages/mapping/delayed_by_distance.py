"""Delays map updates until the robot has driven on."""

import math
from dataclasses import field
from typing import Annotated

from omninav.pipeline import Bounds, Context, Outputs, Stage, State
from omninav.stages.values.belief import GaussianMixture
from omninav.stages.values.map_update import MapUpdate, MapUpdates
from omninav.stages.values.pose import UncertainMotion
from omninav.stages.values.views import WholeView

MAX_WAITING = 500
"""Views that wait, however long the robot stops."""


class DelayedByDistanceState(State):
    """Updates that wait, the distance driven (m) at which each was seen, and the distance driven so far (m)."""

    waiting: list[MapUpdate] = field(default_factory=list)
    seen_at_m: list[float] = field(default_factory=list)
    driven_m: float = 0.0


class DelayedByDistance(Stage):
    """Gives an update with each view and its state once the robot has driven on by some distance.

    A view learned at once would tell the robot, one image later, what it has just told the map: the map would seem to
    confirm the belief and would hold the robot back (docs/experiments/cml_defaults.md). Gross, Koenig & Mueller 2005,
    section 2.1, delay by a short queue for the same reason; how far its length in images takes the robot depends on the
    camera's rate. States of any number of modes are learned. What waits at the end of a log is applied as the next one
    begins, and after the last one by `waiting` (FlushPending). Corrections replace updates that wait and repeat others.
    """

    distance_m: Annotated[float, Bounds(ge=0)] = 4.0
    """Distance driven before a view is learned; 0: at once, as in Porta & Kroese 2004, section 3.2."""

    class Out(Outputs):
        """The updates that are due, in the order in which their views were seen, and those that wait."""

        updates: MapUpdates
        waiting: MapUpdates

    def step(
        self,
        ctx: Context,
        view: WholeView,
        state: GaussianMixture,
        model: UncertainMotion | None,
        queue: DelayedByDistanceState,
        corrections: MapUpdates | None = None,
    ) -> Out:
        """Queue one view, and give what is due."""
        queue.driven_m += 0.0 if model is None else math.fabs(model.steps[1])
        repeated = [] if corrections is None else self._replace(corrections, queue)
        if len(state):
            queue.waiting.append(MapUpdate(view, state, ctx.tick.index))
            queue.seen_at_m.append(queue.driven_m)
        due = sum(1 for at in queue.seen_at_m if at <= queue.driven_m - self.distance_m)
        due = max(due, len(queue.waiting) - MAX_WAITING)
        if ctx.tick.first_of_log:
            due = max(due, sum(1 for update in queue.waiting if update.index < ctx.tick.index))
        ready, queue.waiting, queue.seen_at_m = queue.waiting[:due], queue.waiting[due:], queue.seen_at_m[due:]
        open_from = None if corrections is None else corrections.open_from
        return self.Out(updates=MapUpdates((*repeated, *ready), open_from), waiting=MapUpdates(tuple(queue.waiting)))

    def _replace(self, corrections: MapUpdates, queue: DelayedByDistanceState) -> list[MapUpdate]:
        # Corrections of updates that wait take their places; the others are repeated.
        rows = {update.index: row for row, update in enumerate(queue.waiting)}
        repeated = []
        for update in corrections.items:
            if update.index in rows:
                queue.waiting[rows[update.index]] = update
            else:
                repeated.append(update)
        return repeated
