"""How well each particle explains the view, from the similarities of the references near it."""

import math
from typing import Annotated, Literal

import numba
import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.geometry.nearby import NearbyGrid, nearby_grid
from omninav.stages.geometry.se2 import wrap
from omninav.stages.values.belief import Likelihood, Particles
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import Motion
from omninav.stages.values.similarity import Similarities

Array = npt.NDArray[np.float64]
Floats = npt.NDArray[np.float32]
Ints = npt.NDArray[np.int64]


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
    starts: Ints,
    points: npt.NDArray[np.int32],
    radius: float,
    elsewhere: float,
    trust: float,
) -> Array:
    headings = similarity.shape[1]
    per_radian = headings / (2 * np.pi)
    out = np.empty(len(poses))
    for n in range(len(poses)):
        x, y, heading = poses[n, 0], poses[n, 1], poses[n, 2]
        i, j = int(np.floor((x - origin[0]) / cell)), int(np.floor((y - origin[1]) / cell))
        total = trust * elsewhere
        mass = trust
        if 0 <= i < columns and 0 <= j < lines:
            for at in range(starts[i * lines + j], starts[i * lines + j + 1]):
                r = points[at]
                row = rows[r]
                dx, dy = x - references[r, 0], y - references[r, 1]
                far = (dx * dx + dy * dy) / (radius * radius)
                if row < 0 or far >= 1.0:
                    continue
                weight = (1.0 - far) * (1.0 - far)
                turn = (heading - references[r, 2]) * per_radian
                whole = np.floor(turn)
                part = turn - whole
                h = int(whole) % headings
                value = similarity[row, h] * (1.0 - part) + similarity[row, (h + 1) % headings] * part
                total += weight * value
                mass += weight
        out[n] = total / mass
    return out


def expected_similarity(
    poses: Array,
    references: Array,
    grid: NearbyGrid,
    rows: Ints,
    similarity: Floats,
    radius: float,
    elsewhere: float,
    trust: float,
) -> Array:
    """Similarity of the present view to what is expected at poses: (N, 3) -> (N,).

    The references within `radius` metres speak with weight (1 - d^2 / radius^2)^2, each at the pose's heading (linear
    between the compared headings). `elsewhere` speaks with the weight `trust`: far from all references nothing is known
    and the expectation fades to it. `rows` (R,): each reference's row in `similarity`, -1 where it was not compared.
    """
    return _expected(np.ascontiguousarray(poses), references, rows, similarity, *grid, radius, elsewhere, trust)


def ordinary_match(similarity: Floats, quantile: float) -> float:
    """What an unremarkable reference reaches at its best heading: a quantile of (references, headings)."""
    return float(np.quantile(similarity.max(axis=1), quantile))


class NearReferences(Stage):
    """Likelihood of particles from the references near them: expected similarity to the power of `power`.

    Gross & Koenig 2004, section 2, leave open how S becomes a weight (erratum 23a): w = S^power. The expected
    similarity at a particle is interpolated between the references within `radius_m` and between compared headings.
    What falls below an ordinary match, the `ordinary` quantile over all references of their similarity at the best
    heading, counts as an ordinary match, and so does a pose far from all references (`trust`: how fast the
    expectation fades to it): a robot off the mapped ways resembles no reference, and a filter that prefers the least
    unlike one would be torn from its odometry. Pictures taken at one place are no independent evidence: with `motion`
    wired, the power is scaled by the way since the picture before over `independent_m`, down to `standing` of it.

    `proposals`: poses drawn from the similarity field (`propose: similarity`, the same power; position spread over
    `spread_m` around a reference, heading over one step of the compared headings) or anywhere around the references
    (`uniform`). They carry no weight of their own: `likelihood.anywhere` says how well the view fits anywhere.
    """

    power: Annotated[float, Bounds(gt=0)] = 80.0
    ordinary: Annotated[float, Bounds(ge=0, le=1)] = 0.85
    radius_m: Annotated[float, Bounds(gt=0)] = 0.5
    trust: Annotated[float, Bounds(gt=0)] = 0.05
    independent_m: Annotated[float, Bounds(ge=0)] = 0.2
    standing: Annotated[float, Bounds(ge=0, le=1)] = 0.05
    propose: Literal["similarity", "uniform", "none"] = "similarity"
    proposals: Annotated[int, Bounds(ge=0)] = 100
    spread_m: Annotated[float, Bounds(gt=0)] = 0.2

    class Out(Outputs):
        """Likelihood of each particle, and poses worth a try."""

        likelihood: Likelihood
        proposals: Particles | None = None

    def setup(self, ctx: Context) -> None:
        """No grid yet: the map comes with the first picture."""
        self._map: ReferenceGraph | None = None
        self._length = 0

    def step(
        self,
        ctx: Context,
        similarities: Similarities,
        particles: Particles,
        map: ReferenceGraph,
        motion: Motion | None = None,
    ) -> Out:
        """Weigh all particles."""
        if map is not self._map or len(map) != self._length:
            self._grid = nearby_grid(map.poses, self.radius_m)
            self._map, self._length = map, len(map)
        values = similarities.values
        if not values.size:
            return self.Out(likelihood=Likelihood(np.ones(len(particles.poses))))
        candidates = np.arange(len(map)) if similarities.candidates is None else similarities.candidates
        rows = np.full(len(map), -1, np.int64)
        rows[candidates] = np.arange(len(candidates))
        floor = ordinary_match(values, self.ordinary)
        expected = expected_similarity(
            particles.poses, map.poses, self._grid, rows, values, self.radius_m, floor, self.trust
        )
        power, best = self.power * self._fresh(motion), max(float(values.max()), 1e-12)
        field = (np.maximum(values, floor) / np.float32(best)).astype(np.float64) ** power
        likelihood = Likelihood((np.maximum(expected, floor) / best) ** power, float(field.mean()))
        return self.Out(likelihood=likelihood, proposals=self._proposals(ctx, field, candidates, map))

    def _fresh(self, motion: Motion | None) -> float:
        """Share of the picture's evidence that is new."""
        if motion is None or self.independent_m <= 0.0:
            return 1.0
        return min(1.0, max(self.standing, math.hypot(motion.x, motion.y) / self.independent_m))

    def _proposals(self, ctx: Context, field: Array, candidates: Ints, map: ReferenceGraph) -> Particles | None:
        if self.propose == "none" or not self.proposals or not field.size:
            return None
        headings = field.shape[1]
        if self.propose == "similarity":
            cumulative = np.cumsum(field)
            drawn = np.searchsorted(cumulative, ctx.rng.random(self.proposals) * cumulative[-1], side="right")
            drawn = np.minimum(drawn, field.size - 1)
            poses = map.poses[candidates[drawn // headings]].copy()
            poses[:, 2] += 2 * np.pi * (drawn % headings + ctx.rng.random(self.proposals) - 0.5) / headings
        else:
            poses = map.poses[ctx.rng.integers(len(map), size=self.proposals)].copy()
            poses[:, 2] = ctx.rng.uniform(-np.pi, np.pi, self.proposals)
        poses[:, :2] += self.spread_m * ctx.rng.standard_normal((self.proposals, 2))
        poses[:, 2] = wrap(poses[:, 2])
        return Particles(poses, np.full(self.proposals, 1.0 / self.proposals))
