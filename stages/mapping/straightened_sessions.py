"""Straightens a map of views by the places that its drives came back to."""

import math
from collections.abc import Sequence
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Metrics, MetricSpec, Outputs, Stage, Tick
from omninav.stages.geometry.arrays import Array, Bools
from omninav.stages.geometry.plane.drive_graph import Closures, closure_sigmas, placed_drives, straightened_drives
from omninav.stages.geometry.plane.se2 import compose
from omninav.stages.values.belief import GaussianMixture
from omninav.stages.values.map_update import MapUpdate, MapUpdates
from omninav.stages.values.sessions import Sessions
from omninav.stages.values.views import NoveltyThreshold

SPECS = {
    "straightened.sessions": MetricSpec(title="Drives that the map was learned from", context=True),
    "straightened.joined": MetricSpec(title="Drives joined by places that look alike", context=True),
    "straightened.closures": MetricSpec(title="Loop closures found", context=True),
    "straightened.rejected": MetricSpec(title="Loop closures rejected, as the others contradict them", context=True),
    "straightened.moved_rms_m": MetricSpec(title="Views moved by, root mean square", context=True),
    "straightened.moved_max_m": MetricSpec(title="Views moved by, largest", context=True),
}
MIN_WEIGHT = 0.1
"""Weight of a closure below which the others have contradicted it."""
MIN_GAP = 5.0
"""Way along one drive between the two views of a closure, in distances over which views become new."""
SAMPLES = 1000
"""Views that look for others, evenly spaced over drives of more."""
SIGMA_M, SIGMA_DEG = 0.1, 3.0
"""Standard deviations with which the map learns a straightened pose."""


class StraightenSessions(Stage):
    """Learns a map again from all drives, with poses corrected so that loop closures become consistent.

    Views that look alike although the robot drove on between them, and views of different drives that look alike,
    close loops; a pose graph of odometry and closures gives all poses, with Cauchy's loss on closures, since some are
    wrong. The map then forgets all and learns each view with its new pose. As a log begins this is done with the drives
    before it; wired with `ticks`, a second node of this class does it with all of them after the last log. A drive that
    nothing joins to the others is learned where it was believed to be. Where no closure is left, as in a first drive
    without any crossing, nothing tells how odometry bent the map, and it stays as it is. Manifest fact
    `map_straightened`.

    Not in the papers. Pose graphs: Grisetti et al. 2010, "A tutorial on graph-based SLAM". Defaults:
    docs/experiments/cml_straightened.md.
    """

    max_distance: Annotated[float, Bounds(ge=0, le=1)] = 0.6
    """Distance up to which two views close a loop, as a share of the novelty threshold; 0: the map is left as it is."""

    class Out(Outputs):
        """The updates of the map: those that came in, or all that it is to hold."""

        updates: MapUpdates | None = None
        metrics: Metrics | None = None

    def step(
        self,
        ctx: Context,
        sessions: Sessions | None,
        updates: MapUpdates | None,
        threshold: NoveltyThreshold | None,
        ticks: Sequence[Tick] | None = None,
    ) -> Out:
        """Straighten as a log begins, or after the last one."""
        last = ticks is not None
        if sessions is None or not (last or (ctx.tick.first_of_log and len(sessions))):
            return self.Out(updates=updates)
        if threshold is None or not threshold.settled or not threshold.metres or not self.max_distance:
            return self.Out(updates=updates)
        unit = threshold.metres
        closures = closures_between(sessions, self.max_distance * threshold.distance, MIN_GAP * unit, SAMPLES)
        if not len(closures.pairs):
            return self._as_it_is(ctx, sessions, updates, last)
        drives = sessions.drives
        own = compose(sessions.believed[0], sessions.by_odometry)
        start, joined = placed_drives(own, drives, closures, MIN_GAP * unit)
        usable = joined[drives[closures.pairs]].all(axis=1)
        closures = Closures(closures.pairs[usable], closures.turns[usable])
        if not len(closures.pairs):
            return self._as_it_is(ctx, sessions, updates, last)
        poses, weights = straightened_drives(start, drives, closures, *closure_sigmas(unit), sessions.motions)
        kept = int((weights >= MIN_WEIGHT).sum())
        if not kept:
            return self._as_it_is(ctx, sessions, updates, last)
        apart = ~joined[drives]
        poses[apart] = sessions.believed[apart]
        moved = np.hypot(*(poses - sessions.believed)[sessions.sure & ~apart, :2].T)
        values: dict[str, float] = {
            "sessions": len(joined),
            "joined": int(joined.sum()),
            "closures": len(weights),
            "rejected": len(weights) - kept,
            "moved_rms_m": float(np.sqrt((moved**2).mean())) if len(moved) else 0.0,
            "moved_max_m": float(moved.max(initial=0.0)),
        }
        said = "by {closures} closures between {joined} of {sessions} drives, {rejected} of them rejected"
        ctx.fact("map_straightened", (said + ", {moved_max_m:.2f} m at most").format(**values))
        relearn = MapUpdates(
            self._updates(sessions, poses, ~apart | sessions.sure), relearn=True, sessions=sessions if last else None
        )
        return self.Out(updates=relearn, metrics=Metrics({"straightened": values}, SPECS) if last else None)

    def _as_it_is(self, ctx: Context, sessions: Sessions, updates: MapUpdates | None, last: bool) -> Out:
        ctx.fact(
            "map_straightened", "no: no loop closure was found in the drives, so odometry's drift cannot be corrected"
        )
        items, open_from = ((), None) if updates is None else (updates.items, updates.open_from)
        return self.Out(updates=MapUpdates(items, open_from, sessions=sessions) if last else updates)

    def _updates(self, sessions: Sessions, poses: Array, learned: Bools) -> tuple[MapUpdate, ...]:
        covariance = np.diag([SIGMA_M, SIGMA_M, math.radians(SIGMA_DEG)]) ** 2
        return tuple(
            MapUpdate(
                sessions.view(row),
                GaussianMixture(poses[row][None], covariance[None], np.ones(1)),
                int(sessions.ticks[row]),
                reconstructed=True,
            )
            for row in np.flatnonzero(learned).tolist()
        )


def closures_between(sessions: Sessions, max_distance: float, min_gap_m: float, samples: int) -> Closures:
    """For each view the most alike of each earlier drive, and of its own at least `min_gap_m` metres back.

    A pair counts up to `max_distance`, in the views' unit. Of more than `samples` views that many, evenly spaced, look
    for partners.
    """
    values, drives, driven = sessions.values, sessions.drives, sessions.driven
    pairs, turns = [], []
    for query in np.unique(np.linspace(0, len(sessions) - 1, min(samples, len(sessions))).astype(np.int64)).tolist():
        view = sessions.view(query)
        distances = view.distances(values[:query])
        distances[(drives[:query] == drives[query]) & (driven[:query] > driven[query] - min_gap_m)] = math.inf
        best = [
            int(rows[distances[rows].argmin()])
            for drive in range(drives[query] + 1)
            if len(rows := np.flatnonzero(drives[:query] == drive))
        ]
        near = np.array([row for row in best if distances[row] <= max_distance], np.int64)
        if len(near):
            pairs += [(row, query) for row in near.tolist()]
            turns += view.turns(values[near]).tolist()
    return Closures(np.array(pairs, np.int64).reshape(-1, 2), np.array(turns))
