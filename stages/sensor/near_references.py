"""How well each particle explains the view, from the similarities of the references near it."""

import math
from typing import Annotated, Literal

import numba
import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.geometry.plane.nearest_cells import NearestCells, nearest_cells
from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.geometry.probability.evidence import best_headings, contrast_power, fresh_share
from omninav.stages.values.belief import Likelihood, Particles
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import Motion
from omninav.stages.values.similarity import Similarities

Array = npt.NDArray[np.float64]
Floats = npt.NDArray[np.float32]
Ints = npt.NDArray[np.int64]

CELLS_PER_REACH = 4
FADED = 3.0
"""Beyond so many fading distances a reference says less than 1.2 % of what it says at its own place."""


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _expected(
    poses: Array,
    references: Array,
    rows: Ints,
    similarity: Floats,
    origin: Array,
    cell: float,
    columns: int,
    lines: int,
    nearest: npt.NDArray[np.int32],
    fade: float,
    ordinary: float,
) -> Array:
    headings = similarity.shape[1]
    per_radian, per_cell = headings / (2 * np.pi), 1.0 / cell
    least, decay = 1e-4 * fade * fade, -0.5 / (fade * fade)
    neighbours = nearest.shape[1]
    row = np.empty(neighbours, np.int64)
    apart = np.empty(neighbours)
    turned = np.empty(neighbours)
    out = np.empty(len(poses))
    for n in range(len(poses)):
        x, y, heading = poses[n, 0], poses[n, 1], poses[n, 2]
        out[n] = ordinary
        i, j = int(np.floor((x - origin[0]) * per_cell)), int(np.floor((y - origin[1]) * per_cell))
        if not (0 <= i < columns and 0 <= j < lines):
            continue
        here = nearest[i * lines + j]
        number, closest = 0, np.inf
        for k in range(neighbours):
            r = here[k]
            if r < 0:
                break
            if rows[r] < 0:
                continue
            far_x, far_y = x - references[r, 0], y - references[r, 1]
            far = far_x * far_x + far_y * far_y
            row[number], apart[number], turned[number] = rows[r], far, (heading - references[r, 2]) * per_radian
            number += 1
            closest = min(closest, far)
        if number == 0:
            continue
        total, mass = 0.0, 0.0
        nearly = 0.25 * closest + least
        for k in range(number):
            weight = 1.0 / (apart[k] + nearly)
            turn = turned[k] - headings * np.floor(turned[k] / headings)
            h = min(int(turn), headings - 1)
            before, after = similarity[row[k], h], similarity[row[k], h + 1 if h + 1 < headings else 0]
            total += weight * (before + (after - before) * (turn - h))
            mass += weight
        known = math.exp(decay * closest)
        out[n] = max(ordinary, known * total / mass + (1.0 - known) * ordinary)
    return out


def expected_similarity(
    poses: Array, references: Array, cells: NearestCells, rows: Ints, similarity: Floats, fade: float, ordinary: float
) -> Array:
    """Similarity of the present view to what is expected at poses: (N, 3) -> (N,).

    The references nearest to a pose speak with weight 1 / (d^2 + (d_min / 2)^2), each at the pose's heading (linear
    between the compared headings). With the distance d_min of the nearest one the expectation fades to `ordinary`, by
    exp(-d_min^2 / (2 fade^2)), and it is never below it. `rows` (R,): each reference's row in `similarity`, -1
    where it was not compared.
    """
    poses, similarity = np.ascontiguousarray(poses), np.ascontiguousarray(similarity)
    return _expected(poses, references, rows, similarity, *cells, fade, ordinary)


def weighted_quantile(values: Floats, weights: Array, quantile: float) -> float:
    """The quantile of values that stand for `weights` of their kind: linear between the middles of their shares."""
    order = np.argsort(values, kind="stable")
    upto = np.cumsum(weights[order])
    return float(np.interp(quantile * upto[-1], upto - 0.5 * weights[order], values[order]))


def ordinary_match(
    best: Floats, places: Array, strangers_from: float, quantile: float, sampling_weight: Array | None = None
) -> float:
    """What a reference of some other place reaches at its best heading.

    `best` (R,): each reference's similarity at its best heading; `places` (R, >= 2) where they are (m). Of those
    farther than `strangers_from` metres from the best of all, the `quantile`; where there are none, the median of all.
    `sampling_weight` (R,): how many references of the map each stands for; None: one each.
    """
    gap = places[:, :2] - places[int(np.argmax(best)), :2]
    strange = gap[:, 0] ** 2 + gap[:, 1] ** 2 > strangers_from**2
    if not strange.any():
        return float(np.median(best))
    if sampling_weight is None:
        return float(np.quantile(best[strange], quantile, method="hazen"))  # the same, without sorting
    return weighted_quantile(best[strange], sampling_weight[strange], quantile)


class NearReferences(Stage):
    """Likelihood of particles from the references near them: expected similarity to the power of `power`.

    Gross & Koenig 2004, section 2, leave open how S becomes a weight (erratum 23a): w = S^power. How much similarity
    varies between places differs from world to world, so by default (`power` null) the power is taken from the view:
    `contrast` nats for each standard deviation of log S over the references, each at its best heading.

    The expected similarity at a particle is interpolated between the nearest references and the compared headings, and
    fades with distance to an ordinary match: the `ordinary` quantile over the references of other places. What lies
    below counts as an ordinary match too. So a robot off the mapped ways, which resembles no reference, is not torn
    from its odometry to the least unlike one. Pictures taken at one place are no independent evidence: with `motion`
    wired the power is scaled by the way since the picture before over `independent`, down to `standing` of it.

    Distances are in reaches, the distance at which the map's views have lost half of their excess similarity (port
    `reach`, else `reach_m`): one configuration serves a room, a field and a lawn. `fade`: over which what a reference
    says is lost; `strangers`: from how far away a reference is of another place; `spread`: of proposals.

    Where only some references were compared, those that stand for many (`Similarities.sampling_weight`) count as many, so
    that power, ordinary match and `likelihood.mean_likelihood` are estimates for the whole map.

    `proposals`: poses that a robot put down anywhere would likely be at, weighted by how likely: drawn by weight from
    the similarity field and spread around it (`propose: similarity`), or anywhere around the references, each with
    its own likelihood (`uniform`). `likelihood.mean_likelihood` says how well the view fits anywhere. For who has just been
    put down the picture is the first of its place, so both take its whole evidence. Defaults:
    docs/experiments/omniview_mcl_defaults.md.
    """

    power: Annotated[float, Bounds(gt=0)] | None = None
    contrast: Annotated[float, Bounds(gt=0)] = 3.0
    ordinary: Annotated[float, Bounds(ge=0, le=1)] = 0.8
    neighbours: Annotated[int, Bounds(ge=1)] = 4
    fade: Annotated[float, Bounds(gt=0)] = 1.5
    strangers: Annotated[float, Bounds(ge=0)] = 3.0
    independent: Annotated[float, Bounds(ge=0)] = 0.75
    standing: Annotated[float, Bounds(ge=0, le=1)] = 0.05
    reach_m: Annotated[float, Bounds(gt=0)] = 0.5
    propose: Literal["similarity", "uniform", "none"] = "similarity"
    proposals: Annotated[int, Bounds(ge=0)] = 100
    spread: Annotated[float, Bounds(gt=0)] = 0.4

    class Out(Outputs):
        """Likelihood of each particle, and poses worth a try."""

        likelihood: Likelihood
        proposals: Particles | None = None

    def setup(self, ctx: Context) -> None:
        """No cells yet: the map comes with the first picture."""
        self._map: ReferenceGraph | None = None
        self._length = 0

    def step(
        self,
        ctx: Context,
        similarities: Similarities,
        particles: Particles,
        map: ReferenceGraph,
        motion: Motion | None = None,
        length_scale: LengthScale | None = None,
    ) -> Out:
        """Weigh all particles."""
        unit = self.reach_m if length_scale is None else length_scale.metres
        values = similarities.values
        if not values.size:
            return self.Out(likelihood=Likelihood(np.ones(len(particles.poses))))
        if map is not self._map or len(map) != self._length:
            self._cells = nearest_cells(map.poses, self.neighbours, unit / CELLS_PER_REACH, FADED * self.fade * unit)
            self._map, self._length = map, len(map)
        candidates, rows = similarities.rows(len(map))
        best, each = best_headings(np.ascontiguousarray(values)), similarities.sampling_weight
        floor = ordinary_match(best, map.poses[candidates], self.strangers * unit, self.ordinary, each)
        power, fresh, top = self._power(best, each), self._fresh(motion, unit), max(float(best.max()), 1e-12)
        field = Field(values, floor, top, power, each)
        anywhere, proposals = field.mean, None
        if self.propose == "similarity" and self.proposals:
            proposals = self._from_field(ctx, field, map.poses[candidates], unit)
        elif self.propose == "uniform" and self.proposals:
            poses = self._uniform(ctx, field, map.poses[candidates], unit)
            fit = (self._expected(poses, map, rows, values, unit, floor) / top) ** power
            anywhere, proposals = float(fit.mean()), Particles(poses, fit / fit.sum())
        expected = self._expected(particles.poses, map, rows, values, unit, floor)
        likelihood = Likelihood((expected / top) ** (power * fresh), anywhere, fresh)
        return self.Out(likelihood=likelihood, proposals=proposals)

    def _expected(
        self, poses: Array, map: ReferenceGraph, rows: Ints, values: Floats, unit: float, floor: float
    ) -> Array:
        return expected_similarity(poses, map.poses, self._cells, rows, values, self.fade * unit, floor)

    def _power(self, best: Floats, sampling_weight: Array | None = None) -> float:
        return contrast_power(best, self.contrast, sampling_weight) if self.power is None else self.power

    def _fresh(self, motion: Motion | None, unit: float) -> float:
        """Share of the picture's evidence that is new."""
        way = None if motion is None else math.hypot(motion.x, motion.y)
        return fresh_share(way, self.independent * unit, self.standing)

    def _from_field(self, ctx: Context, field: "Field", references: Array, unit: float) -> Particles:
        chosen, turns = np.divmod(field.draw(ctx.rng, self.proposals), field.headings)
        poses = references[chosen].copy()
        poses[:, 2] += 2 * np.pi * (turns + ctx.rng.random(self.proposals) - 0.5) / field.headings
        return Particles(self._spread(ctx, poses, unit), np.full(self.proposals, 1.0 / self.proposals))

    def _uniform(self, ctx: Context, field: "Field", references: Array, unit: float) -> Array:
        poses = references[field.anywhere(ctx.rng, self.proposals)].copy()
        poses[:, 2] = ctx.rng.uniform(-np.pi, np.pi, self.proposals)
        return self._spread(ctx, poses, unit)

    def _spread(self, ctx: Context, poses: Array, unit: float) -> Array:
        poses[:, :2] += self.spread * unit * ctx.rng.standard_normal((len(poses), 2))
        poses[:, 2] = wrap(poses[:, 2])
        return poses


class Field:
    """Weights (max(S, floor) / top)^power over references and headings, most of which lie on the floor.

    Only what rises above the floor is raised to the power: in a large map that is a few in a hundred. `sampling_weight`
    (references,): how many references of the map each stands for, and counts as; None: one each.
    """

    def __init__(
        self, values: Floats, floor: float, top: float, power: float, sampling_weight: Array | None = None
    ) -> None:
        flat = values.ravel()
        self.headings = values.shape[1]
        self._values, self._floor = values, floor
        each = np.ones(len(values)) if sampling_weight is None else sampling_weight
        self._above = np.flatnonzero(flat > floor)
        counted = each[self._above // self.headings]
        self._raised = np.cumsum(counted * (flat[self._above].astype(np.float64) / top) ** power)
        self._references = np.cumsum(each)
        self._low = np.cumsum(each * (self.headings - np.bincount(self._above // self.headings, minlength=len(values))))
        size = self.headings * float(self._references[-1])
        self._peaks = float(self._raised[-1]) if len(self._above) else 0.0
        self._flat = max(size - float(counted.sum()), 0.0) * (floor / top) ** power
        self.mean = (self._peaks + self._flat) / size
        """Mean weight over the map: how well the view fits anywhere."""

    def draw(self, rng: np.random.Generator, number: int) -> Ints:
        """Cells drawn by weight: (number,) flat indices. What falls to the floor is any cell that lies on it."""
        chance = rng.random(number) * (self._peaks + self._flat)
        on_floor = self._on_floor(rng, number)
        if not len(self._above):
            return on_floor
        peaks = self._above[_drawn(self._raised, chance)]
        drawn: Ints = np.where(chance < self._peaks, peaks, on_floor)
        return drawn

    def _on_floor(self, rng: np.random.Generator, number: int) -> Ints:
        """Cells on the floor, drawn by how many their references stand for; of no meaning where there are none."""
        references = _drawn(self._low, rng.random(number) * float(self._low[-1]))
        low = np.cumsum(self._values[references] <= self._floor, axis=1)
        headings = (low <= (rng.random(number) * low[:, -1])[:, None]).sum(axis=1)
        cells: Ints = references * self.headings + np.minimum(headings, self.headings - 1)
        return cells

    def anywhere(self, rng: np.random.Generator, number: int) -> Ints:
        """References drawn from the whole map, alike for all of them: (number,) rows of the compared ones."""
        return _drawn(self._references, rng.random(number) * float(self._references[-1]))


def _drawn(cumulative: Array, chance: Array) -> Ints:
    at: Ints = np.minimum(np.searchsorted(cumulative, chance, side="right"), len(cumulative) - 1)
    return at
