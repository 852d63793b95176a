"""Proposes poses that the current view itself suggests, for recovery from kidnapping."""

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Context, Outputs, Stage
from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.values.belief import Particles
from omninav.stages.values.length_scale import LengthScale, metres_of
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.similarity import SimilarityField
from omninav.stages.values.track import Track

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
NUMBER = 100
"""Poses proposed at each image."""
SPREAD = 0.4
"""Standard deviation of the positions around a reference, in appearance length scales."""


class SimilarityProposals(Stage):
    """Draws poses from the similarity field, by weight, and spreads them around their references.

    All poses have equal weights. Headings are uniform within the step between compared headings.
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
        """Propose poses for one image."""
        if field is None or (track is not None and track.unbroken):
            return self.Out()
        unit = metres_of(length_scale)
        headings = field.values.shape[1]
        rows, turns = np.divmod(draw_cells(field, ctx.rng, NUMBER), headings)
        references = rows if field.candidates is None else field.candidates[rows]
        poses = map.poses[references].copy()
        poses[:, 2] += 2 * np.pi * (turns + ctx.rng.random(NUMBER) - 0.5) / headings
        poses[:, :2] += SPREAD * unit * ctx.rng.standard_normal((NUMBER, 2))
        poses[:, 2] = wrap(poses[:, 2])
        return self.Out(proposals=Particles(poses, np.full(NUMBER, 1.0 / NUMBER)))


def draw_cells(field: SimilarityField, rng: np.random.Generator, number: int) -> Ints:
    """Cells drawn by weight: (number,) flat indices into the field. Cells at the floor are drawn evenly."""
    peaks = float(field.weights[-1]) if len(field.above) else 0.0
    quantile = rng.random(number) * (peaks + field.floor_weight)
    at_floor = _draw_at_floor(field, rng, number)
    if not len(field.above):
        return at_floor
    drawn: Ints = np.where(quantile < peaks, field.above[_search(field.weights, quantile)], at_floor)
    return drawn


def _draw_at_floor(field: SimilarityField, rng: np.random.Generator, number: int) -> Ints:
    # By how many references each represents; without meaning where no cell is at the floor.
    headings = field.values.shape[1]
    references = _search(field.floor_cells, rng.random(number) * float(field.floor_cells[-1]))
    low = (field.values[references] <= field.floor).cumsum(axis=1)
    turns = np.add.reduce(low <= (rng.random(number) * low[:, -1])[:, None], axis=1)
    cells: Ints = references * headings + np.minimum(turns, headings - 1)
    return cells


def _search(cumulative: Array, quantile: Array) -> Ints:
    at: Ints = np.minimum(cumulative.searchsorted(quantile, side="right"), len(cumulative) - 1)
    return at
