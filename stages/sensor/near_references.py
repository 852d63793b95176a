"""How well each particle explains the view, from the similarities of the references near it."""

import math
from typing import Annotated, Literal

import numba
import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.geometry.nearby import NearestCells, nearest_cells
from omninav.stages.geometry.se2 import wrap
from omninav.stages.values.belief import Likelihood, Particles
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import Motion
from omninav.stages.values.reach import Reach
from omninav.stages.values.similarity import Similarities

Array = npt.NDArray[np.float64]
Floats = npt.NDArray[np.float32]
Ints = npt.NDArray[np.int64]

CELLS_PER_REACH = 4
FADED = 3.0
"""Beyond so many fading distances a reference says less than 1.2 % of what it says at its own place."""


@numba.njit(cache=True, nogil=True)
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
    per_radian = headings / (2 * np.pi)
    out = np.empty(len(poses))
    for n in range(len(poses)):
        x, y, heading = poses[n, 0], poses[n, 1], poses[n, 2]
        out[n] = ordinary
        i, j = int(np.floor((x - origin[0]) / cell)), int(np.floor((y - origin[1]) / cell))
        if not (0 <= i < columns and 0 <= j < lines):
            continue
        closest = np.inf
        for r in nearest[i * lines + j]:
            if r >= 0 and rows[r] >= 0:
                closest = min(closest, (x - references[r, 0]) ** 2 + (y - references[r, 1]) ** 2)
        if closest == np.inf:
            continue
        total, mass = 0.0, 0.0
        for r in nearest[i * lines + j]:
            if r < 0 or rows[r] < 0:
                continue
            far = (x - references[r, 0]) ** 2 + (y - references[r, 1]) ** 2
            weight = 1.0 / (far + 0.25 * closest + 1e-4 * fade * fade)
            turn = (heading - references[r, 2]) * per_radian
            whole = np.floor(turn)
            part = turn - whole
            h = int(whole) % headings
            value = similarity[rows[r], h] * (1.0 - part) + similarity[rows[r], (h + 1) % headings] * part
            total += weight * value
            mass += weight
        known = math.exp(-0.5 * closest / (fade * fade))
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
    poses = np.ascontiguousarray(poses)
    return _expected(poses, references, rows, similarity, *cells, fade, ordinary)


def ordinary_match(best: Floats, places: Array, strangers_from: float, quantile: float) -> float:
    """What a reference of some other place reaches at its best heading.

    `best` (R,): each reference's similarity at its best heading; `places` (R, >= 2) where they are (m). Of those
    farther than `strangers_from` metres from the best of all, the `quantile`; where there are none, the median of all.
    """
    winner = places[int(np.argmax(best)), :2]
    strangers = best[np.hypot(*(places[:, :2] - winner).T) > strangers_from]
    return float(np.quantile(strangers, quantile)) if len(strangers) else float(np.median(best))


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

    `proposals`: poses drawn from the similarity field (`propose: similarity`, by the same weights) or anywhere around
    the references (`uniform`). They carry no weight of their own: `likelihood.anywhere` says how well the view fits
    anywhere. Defaults: docs/experiments/omniview_mcl_defaults.md.
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
        reach: Reach | None = None,
    ) -> Out:
        """Weigh all particles."""
        unit = self.reach_m if reach is None else reach.metres
        values = similarities.values
        if not values.size:
            return self.Out(likelihood=Likelihood(np.ones(len(particles.poses))))
        if map is not self._map or len(map) != self._length:
            self._cells = nearest_cells(map.poses, self.neighbours, unit / CELLS_PER_REACH, FADED * self.fade * unit)
            self._map, self._length = map, len(map)
        candidates = np.arange(len(map)) if similarities.candidates is None else similarities.candidates
        rows = np.full(len(map), -1, np.int64)
        rows[candidates] = np.arange(len(candidates))
        best = values.max(axis=1)
        floor = ordinary_match(best, map.poses[candidates], self.strangers * unit, self.ordinary)
        expected = expected_similarity(particles.poses, map.poses, self._cells, rows, values, self.fade * unit, floor)
        power, top = self._power(best) * self._fresh(motion, unit), max(float(best.max()), 1e-12)
        field = Field(values, floor, top, power)
        likelihood = Likelihood((expected / top) ** power, field.mean)
        return self.Out(likelihood=likelihood, proposals=self._proposals(ctx, field, candidates, map, unit))

    def _power(self, best: Floats) -> float:
        if self.power is not None:
            return self.power
        spread = float(np.log(np.maximum(best, 1e-12)).std())
        return self.contrast / max(spread, 1e-6)

    def _fresh(self, motion: Motion | None, unit: float) -> float:
        """Share of the picture's evidence that is new."""
        if motion is None or self.independent <= 0.0:
            return 1.0
        return min(1.0, max(self.standing, math.hypot(motion.x, motion.y) / (self.independent * unit)))

    def _proposals(
        self, ctx: Context, field: "Field", candidates: Ints, map: ReferenceGraph, unit: float
    ) -> Particles | None:
        if self.propose == "none" or not self.proposals:
            return None
        if self.propose == "similarity":
            references, turns = np.divmod(field.draw(ctx.rng, self.proposals), field.headings)
            poses = map.poses[candidates[references]].copy()
            poses[:, 2] += 2 * np.pi * (turns + ctx.rng.random(self.proposals) - 0.5) / field.headings
        else:
            poses = map.poses[ctx.rng.integers(len(map), size=self.proposals)].copy()
            poses[:, 2] = ctx.rng.uniform(-np.pi, np.pi, self.proposals)
        poses[:, :2] += self.spread * unit * ctx.rng.standard_normal((self.proposals, 2))
        poses[:, 2] = wrap(poses[:, 2])
        return Particles(poses, np.full(self.proposals, 1.0 / self.proposals))


class Field:
    """Weights (max(S, floor) / top)^power over references and headings, most of which lie on the floor.

    Only what rises above the floor is raised to the power: in a large map that is a few in a hundred.
    """

    def __init__(self, values: Floats, floor: float, top: float, power: float) -> None:
        flat = values.ravel()
        self.headings = values.shape[1]
        self._size = flat.size
        self._above = np.flatnonzero(flat > floor)
        self._cumulative = np.cumsum((flat[self._above].astype(np.float64) / top) ** power)
        self._raised = float(self._cumulative[-1]) if len(self._above) else 0.0
        self._flat = (self._size - len(self._above)) * (floor / top) ** power
        self.mean = (self._raised + self._flat) / self._size
        """Mean weight: how well the view fits anywhere."""

    def draw(self, rng: np.random.Generator, number: int) -> Ints:
        """Cells drawn by weight: (number,) flat indices. What falls to the floor is any cell."""
        chance = rng.random(number) * (self._raised + self._flat)
        anywhere = rng.integers(self._size, size=number)
        if not len(self._above):
            return anywhere
        at = np.searchsorted(self._cumulative, chance, side="right")
        return np.where(chance < self._raised, self._above[np.minimum(at, len(self._above) - 1)], anywhere)
