"""Proposes poses that the current view itself suggests, for recovery from kidnapping."""

import numpy as np

from omninav.pipeline import Context, Outputs, Stage
from omninav.stages.geometry.arrays import Array, Ints
from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.values.belief import Particles
from omninav.stages.values.length_scale import LengthScale, metres_of
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.similarity import SimilarityField
from omninav.stages.values.track import Track

NUMBER = 100
"""Poses proposed at each image."""
SHARE_BY_EXCESS = 0.5
"""Share of the poses that is drawn by what a cell weighs above the floor."""
SPREAD = 0.4
"""Standard deviation of the positions around a reference, in appearance length scales."""


class SimilarityProposals(Stage):
    """Draws poses from the similarity field, by weight, and spreads them around their references.

    In a large map nearly all weight is that of the many cells at the floor. So half of the poses are drawn by what a
    cell weighs above the floor, and count as much less as they come more often than by weight (importance sampling from
    a mixture). Headings are uniform within the step between compared headings.
    """

    class Out(Outputs):
        """Poses worth a try; absent without a field, and while the track is unbroken."""

        proposals: Particles | None = None

    def step(
        self,
        ctx: Context,
        field: SimilarityField | None,
        map: ReferenceGraph,
        length_scale: LengthScale | None = None,
        track: Track | None = None,
    ) -> Out:
        if field is None or (track is not None and track.unbroken):
            return self.Out()
        unit = metres_of(length_scale)
        headings = field.values.shape[1]
        cells, weights = draw_cells(field, ctx.rng, NUMBER)
        rows, turns = np.divmod(cells, headings)
        references = rows if field.candidates is None else field.candidates[rows]
        poses = map.poses[references].copy()
        poses[:, 2] += 2 * np.pi * (turns + ctx.rng.random(NUMBER) - 0.5) / headings
        poses[:, :2] += SPREAD * unit * ctx.rng.standard_normal((NUMBER, 2))
        poses[:, 2] = wrap(poses[:, 2])
        return self.Out(proposals=Particles(poses, weights))


def draw_cells(field: SimilarityField, rng: np.random.Generator, number: int) -> tuple[Ints, Array]:
    """Cells of a field, (number,) flat indices, and weights (number,) with which they represent draws by weight.

    Cells at the floor are drawn evenly.
    """
    at_floor = _draw_at_floor(field, rng, number)
    if not len(field.above):
        return at_floor, np.full(number, 1.0 / number)
    peaks, excess = float(field.weights[-1]), float(field.excess[-1])
    quantile = rng.random(number) * (peaks + field.floor_weight)
    drawn, is_above = _search(field.weights, quantile), quantile < peaks
    sharp = int(SHARE_BY_EXCESS * number) if excess > 0.0 else 0
    drawn[:sharp], is_above[:sharp] = _search(field.excess, rng.random(sharp) * excess), True
    by_weight = np.maximum(_steps(field.weights, drawn) / (peaks + field.floor_weight), 1e-300)  # small ones round to 0
    by_excess = is_above * _steps(field.excess, drawn) / max(excess, 1e-300)
    weights = 1.0 / (1.0 + sharp / number * (by_excess / by_weight - 1.0))
    return np.where(is_above, field.above[drawn], at_floor), weights / np.add.reduce(weights)


def _steps(cumulative: Array, at: Ints) -> Array:
    return cumulative[at] - np.where(at > 0, cumulative[at - 1], 0.0)


def _draw_at_floor(field: SimilarityField, rng: np.random.Generator, number: int) -> Ints:
    # By how many references each represents; without meaning where no cell is at the floor.
    headings = field.values.shape[1]
    references = _search(field.floor_cells, rng.random(number) * float(field.floor_cells[-1]))
    low = (field.values[references] <= field.floor).cumsum(axis=1)
    turns = np.add.reduce(low <= (rng.random(number) * low[:, -1])[:, None], axis=1)
    return np.asarray(references * headings + np.minimum(turns, headings - 1))


def _search(cumulative: Array, quantile: Array) -> Ints:
    return np.minimum(cumulative.searchsorted(quantile, side="right"), len(cumulative) - 1)
