"""Only what is certain is learned, some time later; the way between two certain states is worked out afterwards."""

import math
from dataclasses import field
from typing import Annotated, Literal

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage, State
from omninav.stages.geometry.plane.odometry_motion import motion_gaussian
from omninav.stages.geometry.plane.path_reconstruction import reconstructed
from omninav.stages.values.belief import GaussianMixture
from omninav.stages.values.map_update import MapUpdate, MapUpdates
from omninav.stages.values.pose import UncertainMotion
from omninav.stages.values.view_mixtures import ViewMixtures
from omninav.stages.values.views import Neighbours, WholeView

from .unimodality import certain_state


class UnimodalQueueState(State):
    """Lessons waiting for their time, the last certain state, and the views and motions since then."""

    queue: list[MapUpdate] = field(default_factory=list)
    certain: GaussianMixture | None = None
    seen: list[MapUpdate] = field(default_factory=list)
    ways: list[UncertainMotion] = field(default_factory=list)


class UnimodalQueue(Stage):
    """Lessons from unimodal states only, `length` ticks late; states between two unimodal ones are reconstructed.

    Gross, Koenig & Mueller 2005, section 2.1: updating at once would feed the map's own errors back into the state. The
    queue gives out what is left in it when the next log begins, and after the last log by `waiting` (FlushPending).

    The test for a unimodal state is not given (erratum 12a). `unimodal: share`: the components nearer to the heaviest
    than `near_below` (squared Mahalanobis distance) hold more than `least_share` of the weight; the lesson's state has
    their moments. Where no view is known there is no evidence against a wrong part either, so that a high share would
    learn nothing there. `single`: there is one component. Either way its heading's standard deviation is at most
    `most_deg` (one that nothing is known of has 104 degrees), and that of the position at most `most_m` (0: any).

    Views in between wait until the next unimodal state, and then get the most likely states along the odometry between
    the two (`reconstruct`; geometry/path_reconstruction.py). They are dropped where odometry misses that state by more
    than `missed_below` (squared Mahalanobis distance; 16.3: 99.9 % of drives in which nobody lifted the robot; 0: any),
    where a motion is missing, and beyond `longest` views.
    """

    length: Annotated[int, Bounds(ge=0)] = 20
    unimodal: Literal["share", "single"] = "share"
    least_share: Annotated[float, Bounds(ge=0, lt=1)] = 0.5
    near_below: Annotated[float, Bounds(ge=0)] = 7.81
    most_m: Annotated[float, Bounds(ge=0)] = 0.0
    most_deg: Annotated[float, Bounds(gt=0)] = 45.0
    reconstruct: bool = True
    missed_below: Annotated[float, Bounds(ge=0)] = 16.3
    longest: Annotated[int, Bounds(ge=0)] = 500

    class Out(Outputs):
        """What is due in this tick, in the order in which it was seen, and what would be due as the next log begins."""

        updates: MapUpdates
        waiting: MapUpdates

    def step(
        self,
        ctx: Context,
        view: WholeView,
        state: GaussianMixture,
        model: UncertainMotion | None,
        waiting: UnimodalQueueState,
        neighbours: Neighbours | None = None,
        map: ViewMixtures | None = None,
    ) -> Out:
        """Take one view in, and give out what has waited long enough."""
        now = ctx.tick.index
        due: list[MapUpdate] = []
        if ctx.tick.first_of_log:
            due, waiting.queue = waiting.queue, []
        if model is None:
            self._forget_the_way(ctx, waiting)
        else:
            waiting.ways.append(model)
        single = self._single(state)
        if single is not None:
            lesson = MapUpdate(view, single, now)
            waiting.queue += [*self._between(ctx, waiting, single), lesson]
            waiting.certain, waiting.seen, waiting.ways = single, [], []
        elif waiting.certain is None or not self.reconstruct or len(waiting.seen) >= self.longest:
            self._forget_the_way(ctx, waiting)
            ctx.count("view_not_learned", detail="lessons: views between states that are not certain are not learned")
        else:
            waiting.seen.append(MapUpdate(view, state, now, reconstructed=True))
        ready = sum(1 for lesson in waiting.queue if lesson.index <= now - self.length)
        due, waiting.queue = due + waiting.queue[:ready], waiting.queue[ready:]
        return self.Out(updates=MapUpdates(tuple(due)), waiting=MapUpdates(tuple(waiting.queue)))

    def _single(self, state: GaussianMixture) -> GaussianMixture | None:
        # The state as one Gaussian, where it is certain.
        if self.unimodal == "single" and len(state) > 1:
            return None
        certain = certain_state(state, self.least_share, self.near_below)
        if certain is None:
            return None
        mean, covariance = certain
        sigmas = np.sqrt(np.diag(covariance))
        if sigmas[2] > math.radians(self.most_deg) or (self.most_m and max(sigmas[:2]) > self.most_m):
            return None
        return GaussianMixture(mean[None], covariance[None], np.ones(1))

    def _between(self, ctx: Context, waiting: UnimodalQueueState, end: GaussianMixture) -> list[MapUpdate]:
        # MapUpdates of the views since the last certain state.
        start, seen = waiting.certain, waiting.seen
        if start is None or not seen:
            return []
        steps = [motion_gaussian(way.steps, way.sigmas) for way in waiting.ways]
        means, covariances, missed = reconstructed(
            start.means[0],
            start.covariances[0],
            np.stack([step[0] for step in steps]),
            np.stack([step[1] for step in steps]),
            end.means[0],
            end.covariances[0],
            independent=False,
        )
        if self.missed_below and missed > self.missed_below:
            self._forget_the_way(ctx, waiting)
            return []
        ctx.count("view_reconstructed", len(seen))
        states = (
            GaussianMixture(means[k : k + 1], covariances[k : k + 1], np.ones(1)) for k in range(1, len(seen) + 1)
        )
        return [MapUpdate(s.view, state, s.index, reconstructed=True) for s, state in zip(seen, states, strict=True)]

    def _forget_the_way(self, ctx: Context, waiting: UnimodalQueueState) -> None:
        if waiting.seen:
            ctx.count(
                "view_not_learned",
                len(waiting.seen),
                detail="lessons: views between states that are not certain are not learned",
            )
        waiting.certain, waiting.seen, waiting.ways = None, [], []
