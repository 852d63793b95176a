"""A view is learned from when the robot has left it behind."""

import math
from dataclasses import field
from typing import Annotated

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Context, Outputs, Stage, State
from omninav.stages.geometry.plane.odometry_motion import motion_gaussian
from omninav.stages.geometry.plane.path_reconstruction import reconstructed
from omninav.stages.geometry.probability.gaussians import squared_distances
from omninav.stages.values.belief import GaussianMixture
from omninav.stages.values.map_update import MapUpdate, MapUpdates
from omninav.stages.values.pose import UncertainMotion
from omninav.stages.values.view_mixtures import ViewMixtures
from omninav.stages.values.views import Neighbours, WholeView

from .unimodality import certain_state

Array = npt.NDArray[np.float64]


class DelayedByDistanceState(State):
    """Lessons that wait, and how far the robot had driven when it saw each (m).

    `past`: the last views with their states as they are known by now, learned or not; `ways`: the motions between them.
    `jumps`: where the belief left the way that odometry leads: the last certain picture before, and the age (in the
    map's steps) of the oldest view that spoke for the new place.
    """

    lessons: list[MapUpdate] = field(default_factory=list)
    seen_at: list[float] = field(default_factory=list)
    driven: float = 0.0
    past: list[MapUpdate] = field(default_factory=list)
    ways: list[UncertainMotion] = field(default_factory=list)
    jumps: list[tuple[int, int]] = field(default_factory=list)


class DelayedByDistance(Stage):
    """Each view waits, with the state it was seen in, until the robot has driven on for `metres`.

    A view that is learned at once tells the robot, one picture later, what it has just told the map: the map seems to
    confirm the belief, and holds the robot back at where it was (docs/experiments/cml_defaults.md). Gross, Koenig &
    Mueller 2005, section 2.1, delay by a short queue for the same reason; how far its length in pictures takes the
    robot depends on the camera's rate. States of any number of modes are learned. `longest`: no more views than these
    wait, however long the robot stands. What waits when a log ends is learned as the next one begins, and after the
    last one by `waiting` (FlushPending).

    `retrace`: wrong places in the map lead the belief away from where odometry, rightly, had it; where the map is right
    again, the belief comes back. That shows: it jumps to where odometry leads from the state before it was led away
    (both by `missed_below`, squared Mahalanobis, 3 degrees of freedom: 16.3 is 99.9 %), because of views older than
    those that led it away (all that is known is known from the place where the map was begun). So the robot was not
    lifted in between; its states there are worked out along odometry (ten Hagen & Kroese 2002), and views whose state
    cannot be what was believed are learned with it: once more, where they had been learned. It
    looks back over `longest` views.

    `back_propagate` (Porta & Kroese 2004, section 3.2, last sentence, for robots that nobody lifts). Where the map
    makes the state at least `improved` times as certain (the root of the determinants' ratio) as it was one picture
    before, and odometry leads there, the states since it was last known as well are worked out from both ends (ten
    Hagen & Kroese 2002), and those that are known better by it take the place of what was learned; so do those that
    `retrace` puts right. A jump, which odometry does not explain, ends it, so that a robot that is lifted now and then
    gains by it too (docs/experiments/cml_defaults.md). `mapping=fused_mixtures` takes lessons back, other maps learn
    them once more.
    """

    metres: Annotated[float, Bounds(ge=0)] = 4.0
    longest: Annotated[int, Bounds(ge=0)] = 500
    retrace: bool = True
    missed_below: Annotated[float, Bounds(ge=0)] = 16.3
    back_propagate: bool = True
    improved: Annotated[float, Bounds(gt=1)] = 2.0

    class Out(Outputs):
        """What has been left behind, in the order in which it was seen, and what would be as the next log begins."""

        updates: MapUpdates
        waiting: MapUpdates

    def step(
        self,
        ctx: Context,
        view: WholeView,
        state: GaussianMixture,
        model: UncertainMotion | None,
        behind: DelayedByDistanceState,
        neighbours: Neighbours | None = None,
        map: ViewMixtures | None = None,
    ) -> Out:
        """Take one view in, and give out those that are left behind."""
        behind.driven += 0.0 if model is None else math.fabs(model.steps[1])
        lesson = MapUpdate(view, state, ctx.tick.index)
        again: list[MapUpdate] = []
        if self.retrace or self.back_propagate:
            remember(lesson, model, behind, self.longest)
            if neighbours is not None and map is not None and len(neighbours.rows) and len(behind.past) > 1:
                again = self._corrected(ctx, int(map.born[neighbours.rows].min()), behind)
        if len(state):
            behind.lessons.append(lesson)
            behind.seen_at.append(behind.driven)
        due = sum(1 for at in behind.seen_at if at <= behind.driven - self.metres)
        due = max(due, len(behind.lessons) - self.longest)
        if ctx.tick.first_of_log:
            due = max(due, sum(1 for lesson in behind.lessons if lesson.index < ctx.tick.index))
        ready, behind.lessons, behind.seen_at = behind.lessons[:due], behind.lessons[due:], behind.seen_at[due:]
        open_from = behind.past[0].index if self.back_propagate else None
        return self.Out(updates=MapUpdates((*again, *ready), open_from), waiting=MapUpdates(tuple(behind.lessons)))

    def _corrected(self, ctx: Context, oldest: int, behind: DelayedByDistanceState) -> list[MapUpdate]:
        # What is to be learned again, now that a view of the map, the oldest of this age, spoke for the present state.
        end = certain_state(behind.past[-1].state)
        rows = range(len(behind.past) - 2, -1, -1)
        before = next((row for row in rows if certain_state(behind.past[row].state) is not None), None)
        if end is None or before is None:
            return []
        if led(behind, before, end)[2] <= self.missed_below:
            return self._propagated(ctx, behind, end, len(behind.past) - 2)
        ctx.count("belief_jumped")
        places = {lesson.index: row for row, lesson in enumerate(behind.past)}
        for place, (index, age) in reversed(list(enumerate(behind.jumps))) if self.retrace else ():
            if oldest < age:
                means, covariances, missed = led(behind, places[index], end)
                if missed <= self.missed_below:
                    behind.jumps = behind.jumps[:place]
                    again = self._retraced(ctx, behind, places[index], means, covariances)
                    return [*again, *self._propagated(ctx, behind, end, places[index])]
        behind.jumps.append((behind.past[before].index, oldest))
        return []

    def _propagated(
        self, ctx: Context, behind: DelayedByDistanceState, end: tuple[Array, Array], latest: int
    ) -> list[MapUpdate]:
        # The states since one, up to row `latest`, that was known about as well as the present one, `end`.
        if not self.back_propagate:
            return []
        enough = self.improved**2 * doubt(end)
        after = behind.jumps[-1][0] if behind.jumps else -1
        known = (row for row in range(latest, -1, -1) if doubt(certain_state(behind.past[row].state)) <= enough)
        first = next(known, latest)
        if first == latest or behind.past[first].index <= after:
            return []
        means, covariances, missed = led(behind, first, end)
        if missed > self.missed_below:
            return []
        put = {}
        for k in range(first + 1, len(behind.past) - 1):
            mean, covariance = means[k - first], covariances[k - first]
            if doubt((mean, covariance)) < doubt(certain_state(behind.past[k].state)):
                put[k] = GaussianMixture(mean[None], covariance[None], np.ones(1))
        ctx.count("view_propagated", len(put))
        return put_right(behind, put)

    def _retraced(
        self, ctx: Context, behind: DelayedByDistanceState, row: int, means: Array, covariances: Array
    ) -> list[MapUpdate]:
        put = {}
        for k in range(row + 1, len(behind.past) - 1):
            mean, covariance = means[k - row][None], covariances[k - row][None]
            believed = certain_state(behind.past[k].state)
            if believed is not None:
                apart = squared_distances(mean, covariance, believed[0][None], believed[1][None])[0, 0]
                if apart <= self.missed_below:
                    continue
            put[k] = GaussianMixture(mean, covariance, np.ones(1))
        ctx.count("view_retraced", len(put))
        return put_right(behind, put)


def doubt(state: tuple[Array, Array] | None) -> float:
    """How much room a Gaussian leaves: the determinant of its covariance; without one, all there is."""
    return math.inf if state is None else float(np.linalg.det(state[1]))


def remember(lesson: MapUpdate, model: UncertainMotion | None, behind: DelayedByDistanceState, longest: int) -> None:
    """Add a view to the way the robot came; where there is no motion, a way begins."""
    if model is None:
        behind.past, behind.ways, behind.jumps = [lesson], [], []
        return
    behind.past, behind.ways = [*behind.past, lesson][-longest - 1 :], [*behind.ways, model][-longest:]
    behind.jumps = [jump for jump in behind.jumps if jump[0] >= behind.past[0].index]


def led(behind: DelayedByDistanceState, row: int, end: tuple[Array, Array]) -> tuple[Array, Array, float]:
    """The way from a certain state in the past to the present one, `end`, along odometry: see `reconstructed`.

    The two count as independent: after a jump, and where the map has made the present state much more certain, what is
    known of it comes from the map.
    """
    start = certain_state(behind.past[row].state)
    assert start is not None
    steps = [motion_gaussian(way.steps, way.sigmas) for way in behind.ways[row:]]
    motions, noise = (np.stack(each) for each in zip(*steps, strict=True))
    return reconstructed(*start, motions, noise, *end)


def put_right(behind: DelayedByDistanceState, states: dict[int, GaussianMixture]) -> list[MapUpdate]:
    """Replace states of the past, also of lessons that wait; gives lessons for those that had been given out."""
    waiting = {lesson.index: place for place, lesson in enumerate(behind.lessons)}
    again: list[MapUpdate] = []
    for row in sorted(states):
        old = behind.past[row]
        fresh = MapUpdate(old.view, states[row], old.index, reconstructed=True)
        behind.past[row] = fresh
        if old.index in waiting:
            behind.lessons[waiting[old.index]] = fresh
        elif len(old.state):
            again.append(fresh)
    return again
