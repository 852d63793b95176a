"""Corrects past states along the odometry once the map has made the present one certain."""

import math
from collections.abc import Iterable
from dataclasses import field
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage, State
from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.plane.odometry_motion import motion_gaussian
from omninav.stages.geometry.probability.gaussians import squared_distances
from omninav.stages.values.belief import GaussianMixture
from omninav.stages.values.map_update import MapUpdate, MapUpdates
from omninav.stages.values.pose import UncertainMotion
from omninav.stages.values.view_mixtures import ViewMixtures
from omninav.stages.values.views import Neighbours, WholeView

from .path_reconstruction import reconstruct_path
from .unimodality import unimodal_state

Pose = tuple[Array, Array]

MIN_IMPROVEMENT = 2.0
"""Gain in certainty from which a state is propagated: the root of the determinants' ratio."""


class FixedLagSmootherState(State):
    """The last views with their states as known by now, and the motions between them.

    `jumps`: where the belief left the path of the odometry: the tick of the last unimodal state before, and the age (in
    the map's steps) of the oldest view that supported the new place.
    """

    past: list[MapUpdate] = field(default_factory=list)
    motions: list[UncertainMotion] = field(default_factory=list)
    jumps: list[tuple[int, int]] = field(default_factory=list)


class FixedLagSmoother(Stage):
    """Corrects past states along the odometry, between two certain ones (ten Hagen & Kroese 2002).

    `reconstruct_path`: wrong places in the map lead the belief away from the path of the odometry; where the map is
    right again, the belief returns. That shows as a jump to where odometry leads from the state before it was led away,
    supported by views older than those that led it away (everything is known from the place where the map was begun).
    So the robot was not kidnapped in between: its states there are reconstructed along the odometry, and those that
    contradict the belief are corrected.

    `back_propagate` (Porta & Kroese 2004, section 3.2, last sentence, for robots that are never kidnapped): where the
    map makes the state more certain and odometry leads there, the states since it was last as certain are reconstructed
    from both ends, and those that become more certain are corrected. A jump that odometry does not explain ends the
    path, so that a robot that is kidnapped now and then gains too (docs/experiments/cml_defaults.md).
    `mapping=fused_mixtures` undoes earlier updates; other maps learn a corrected view once more.
    """

    reconstruct_path: bool = True
    """Correct states that contradict the path between two jumps."""
    back_propagate: bool = True
    """Correct states that become more certain by the present one."""
    odometry_gate: Annotated[float, Bounds(ge=0)] = 16.3
    """Squared Mahalanobis distance, 3 degrees of freedom, up to which odometry explains a state; 16.3: 99.9 %."""
    max_views: Annotated[int, Bounds(ge=0)] = 500
    """Past views that are kept."""

    class Out(Outputs):
        corrections: MapUpdates

    def step(
        self,
        ctx: Context,
        view: WholeView,
        state: GaussianMixture,
        model: UncertainMotion | None,
        path: FixedLagSmootherState,
        neighbours: Neighbours | None = None,
        map: ViewMixtures | None = None,
    ) -> Out:
        """Add one view to the path, and correct the states before it."""
        corrected: list[MapUpdate] = []
        remember(MapUpdate(view, state, ctx.tick.index), model, path, self.max_views)
        if neighbours is not None and map is not None and len(neighbours.rows) and len(path.past) > 1:
            corrected = self._corrected(ctx, int(map.born[neighbours.rows].min()), path)
        open_from = path.past[0].index if self.back_propagate else None
        return self.Out(corrections=MapUpdates(tuple(corrected), open_from))

    def _corrected(self, ctx: Context, oldest: int, path: FixedLagSmootherState) -> list[MapUpdate]:
        # `oldest`: the age of the oldest view of the map that supports the present state.
        end = unimodal_state(path.past[-1].state)
        rows = range(len(path.past) - 2, -1, -1)
        before = next((row for row in rows if unimodal_state(path.past[row].state) is not None), None)
        if end is None or before is None:
            return []
        if path_to(path, before, end)[2] <= self.odometry_gate:
            return self._propagated(ctx, path, end, len(path.past) - 2)
        ctx.count("belief_jumped")
        places = {update.index: row for row, update in enumerate(path.past)}
        for place, (index, age) in reversed(list(enumerate(path.jumps))) if self.reconstruct_path else ():
            if oldest < age:
                means, covariances, mismatch = path_to(path, places[index], end)
                if mismatch <= self.odometry_gate:
                    path.jumps = path.jumps[:place]
                    corrected = self._reconstructed(ctx, path, places[index], means, covariances)
                    return [*corrected, *self._propagated(ctx, path, end, places[index])]
        path.jumps.append((path.past[before].index, oldest))
        return []

    def _propagated(self, ctx: Context, path: FixedLagSmootherState, end: Pose, latest: int) -> list[MapUpdate]:
        # The states since the last one, up to row `latest`, that was about as certain as the present one, `end`.
        if not self.back_propagate:
            return []
        enough = MIN_IMPROVEMENT**2 * volume(end)
        after = path.jumps[-1][0] if path.jumps else -1
        certain = (row for row in range(latest, -1, -1) if volume(unimodal_state(path.past[row].state)) <= enough)
        first = next(certain, latest)
        if first == latest or path.past[first].index <= after:
            return []
        means, covariances, mismatch = path_to(path, first, end)
        if mismatch > self.odometry_gate:
            return []
        rows = [
            row
            for row in range(first + 1, len(path.past) - 1)
            if volume((means[row - first], covariances[row - first])) < volume(unimodal_state(path.past[row].state))
        ]
        ctx.count("view_propagated", len(rows))
        return correct(path, rows, means, covariances, first)

    def _reconstructed(
        self, ctx: Context, path: FixedLagSmootherState, first: int, means: Array, covariances: Array
    ) -> list[MapUpdate]:
        rows = []
        for row in range(first + 1, len(path.past) - 1):
            believed = unimodal_state(path.past[row].state)
            here = means[row - first][None], covariances[row - first][None]
            gap = math.inf if believed is None else squared_distances(*here, *(part[None] for part in believed))[0, 0]
            if gap > self.odometry_gate:
                rows.append(row)
        ctx.count("view_reconstructed", len(rows))
        return correct(path, rows, means, covariances, first)


def volume(state: Pose | None) -> float:
    """The determinant of a Gaussian's covariance; infinite without one."""
    return math.inf if state is None else float(np.linalg.det(state[1]))


def remember(update: MapUpdate, model: UncertainMotion | None, path: FixedLagSmootherState, max_views: int) -> None:
    """Add a view to the path; without a motion a new path begins."""
    if model is None:
        path.past, path.motions, path.jumps = [update], [], []
        return
    path.past, motions = [*path.past, update][-max_views - 1 :], [*path.motions, model]
    path.motions = motions[len(motions) - len(path.past) + 1 :]
    path.jumps = [jump for jump in path.jumps if jump[0] >= path.past[0].index]


def path_to(path: FixedLagSmootherState, row: int, end: Pose) -> tuple[Array, Array, float]:
    """The path from a unimodal past state to the present one, `end`, along the odometry: see `reconstruct_path`.

    The two count as independent: after a jump, and where the map has made the present state much more certain, the new
    information comes from the map.
    """
    start = unimodal_state(path.past[row].state)
    assert start is not None
    steps = [motion_gaussian(motion.steps, motion.sigmas) for motion in path.motions[row:]]
    motions, noise = (np.stack(each) for each in zip(*steps, strict=True))
    return reconstruct_path(*start, motions, noise, *end)


def correct(
    path: FixedLagSmootherState, rows: Iterable[int], means: Array, covariances: Array, first: int
) -> list[MapUpdate]:
    """Replace the states of some rows of the past; gives updates for those that had a state before."""
    corrected: list[MapUpdate] = []
    for row in rows:
        old, k = path.past[row], row - first
        state = GaussianMixture(means[k][None], covariances[k][None], np.ones(1))
        path.past[row] = MapUpdate(old.view, state, old.index, reconstructed=True)
        if len(old.state):
            corrected.append(path.past[row])
    return corrected
