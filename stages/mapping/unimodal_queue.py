"""Delays map updates in a queue, from unimodal states only."""

import math
from dataclasses import field
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage, State
from omninav.stages.geometry.plane.odometry_motion import motion_gaussian
from omninav.stages.values.belief import GaussianMixture
from omninav.stages.values.map_update import MapUpdate, MapUpdates
from omninav.stages.values.pose import UncertainMotion
from omninav.stages.values.views import WholeView

from .path_reconstruction import reconstruct_path
from .unimodality import unimodal_state

NEAR_BELOW = 7.81
"""Squared Mahalanobis distance that counts as near: the 95 % quantile for three degrees of freedom."""
MAX_WAITING = 500
"""Views between two unimodal states, beyond which they are dropped."""


class UnimodalQueueState(State):
    """Updates that wait, the last unimodal state, and the views and motions since then."""

    queue: list[MapUpdate] = field(default_factory=list)
    last: GaussianMixture | None = None
    seen: list[MapUpdate] = field(default_factory=list)
    motions: list[UncertainMotion] = field(default_factory=list)


class UnimodalQueue(Stage):
    """Gives updates from unimodal states only, some ticks late; states in between are reconstructed.

    Gross, Koenig & Mueller 2005, section 2.1: immediate updates would feed the map's own errors back into the state.
    The queue is flushed as the next log begins, and after the last log by `waiting` (FlushPending). Views in between
    wait for the next unimodal state and then get the most likely states along the odometry between the two
    (`geometry/plane/path_reconstruction.py`). They are dropped where odometry misses that state or a motion is missing.

    The paper does not give the test for a unimodal state (erratum 12a in docs/papers.md). In a new place there is no
    evidence against a wrong mode either, so that a high `min_share` would learn nothing there.
    """

    length: Annotated[int, Bounds(ge=0)] = 20
    """Delay of an update (ticks)."""
    min_share: Annotated[float, Bounds(ge=0, lt=1)] = 0.5
    """Share of the weight near the heaviest component of a unimodal state; the update has the moments of that part."""
    max_sigma_deg: Annotated[float, Bounds(gt=0)] = 45.0
    """Largest standard deviation of a unimodal state's heading; an unknown heading has 104 degrees."""
    reconstruct: bool = True
    """Reconstruct the states between two unimodal ones; else their views are dropped."""
    odometry_gate: Annotated[float, Bounds(ge=0)] = 16.3
    """Squared Mahalanobis distance up to which odometry explains a state; 16.3: 99.9 % of drives without kidnapping; 0:
    any."""

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
        pending: UnimodalQueueState,
    ) -> Out:
        """Queue one view, and give what is due."""
        now = ctx.tick.index
        due: list[MapUpdate] = []
        if ctx.tick.first_of_log:
            due, pending.queue = pending.queue, []
        if model is None:
            self._drop_path(ctx, pending)
        else:
            pending.motions.append(model)
        single = self._single(state)
        if single is not None:
            update = MapUpdate(view, single, now)
            pending.queue += [*self._between(ctx, pending, single), update]
            pending.last, pending.seen, pending.motions = single, [], []
        elif pending.last is None or not self.reconstruct or len(pending.seen) >= MAX_WAITING:
            self._drop_path(ctx, pending)
            ctx.count("view_not_learned", detail="the belief had several modes (map_update)")
        else:
            pending.seen.append(MapUpdate(view, state, now, reconstructed=True))
        ready = sum(1 for update in pending.queue if update.index <= now - self.length)
        due, pending.queue = due + pending.queue[:ready], pending.queue[ready:]
        return self.Out(updates=MapUpdates(tuple(due)), waiting=MapUpdates(tuple(pending.queue)))

    def _single(self, state: GaussianMixture) -> GaussianMixture | None:
        # The state as one Gaussian, where it is unimodal.
        unimodal = unimodal_state(state, self.min_share, NEAR_BELOW)
        if unimodal is None:
            return None
        mean, covariance = unimodal
        if math.sqrt(covariance[2, 2]) > math.radians(self.max_sigma_deg):
            return None
        return GaussianMixture(mean[None], covariance[None], np.ones(1))

    def _between(self, ctx: Context, pending: UnimodalQueueState, end: GaussianMixture) -> list[MapUpdate]:
        # Updates of the views since the last unimodal state.
        start, seen = pending.last, pending.seen
        if start is None or not seen:
            return []
        steps = [motion_gaussian(motion.steps, motion.sigmas) for motion in pending.motions]
        motions, noise = (np.stack(each) for each in zip(*steps, strict=True))
        means, covariances, mismatch = reconstruct_path(
            start.means[0], start.covariances[0], motions, noise, end.means[0], end.covariances[0], independent=False
        )
        if self.odometry_gate and mismatch > self.odometry_gate:
            self._drop_path(ctx, pending)
            return []
        ctx.count("view_reconstructed", len(seen))
        states = (
            GaussianMixture(means[k : k + 1], covariances[k : k + 1], np.ones(1)) for k in range(1, len(seen) + 1)
        )
        return [MapUpdate(s.view, state, s.index, reconstructed=True) for s, state in zip(seen, states, strict=True)]

    def _drop_path(self, ctx: Context, pending: UnimodalQueueState) -> None:
        if pending.seen:
            ctx.count("view_not_learned", len(pending.seen), detail="the belief had several modes (map_update)")
        pending.last, pending.seen, pending.motions = None, [], []
