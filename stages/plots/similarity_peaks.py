"""Keeps what a plot needs of the similarities: the best one of each reference, at some frames."""

import numpy as np

from omninav.pipeline import Context, Outputs, Stage, Tick, Value
from omninav.stages.geometry.arrays import Floats, Ints
from omninav.stages.values.similarity import Similarities

from .snapshot_times import is_snapshot_frame


class Peaks(Value):
    """The best of each reference's similarities, and all headings of the best reference.

    `best` (references,) in [0, 1]; `candidates` (references,) their indices in the map, None: all; `profile`
    (headings,) of reference number `reference` of the map, headings as in `Similarities`.
    """

    best: Floats
    candidates: Ints | None
    reference: int
    profile: Floats


class SimilarityPeaks(Stage):
    """Keeps, at even steps the best similarity of each reference and the best one's headings."""

    class Out(Outputs):
        """`peaks`: absent at all other frames."""

        peaks: Peaks | None = None

    def step(self, ctx: Context, tick: Tick, similarities: Similarities) -> Out:
        values = similarities.values
        if not is_snapshot_frame(tick.frame) or not len(values):
            return self.Out()
        best = values.max(axis=1)
        winner = int(np.argmax(best))
        candidates = similarities.candidates
        reference = winner if candidates is None else int(candidates[winner])
        return self.Out(peaks=Peaks(best.astype(np.float32), candidates, reference, values[winner].astype(np.float32)))
