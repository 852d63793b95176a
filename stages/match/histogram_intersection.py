"""Similarity as the mean intersection of the segments' histograms."""

from omninav.pipeline import Context, Stage
from omninav.stages.geometry.appearance.segments import similarities
from omninav.stages.geometry.arrays import Floats, Ints
from omninav.stages.values.candidates import Candidates
from omninav.stages.values.features import SegmentFeatures, SegmentHistograms
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.visual_words import WordSimilarities

from .reference_match import LastView, ReferenceMatch


class HistogramIntersection(ReferenceMatch, Stage):
    """Similarity as the mean intersection of all segments' histograms; no segment is left out.

    Non-selective, as is the L2 norm, the alternative that Gross & Koenig 2004 name (section 2). Raises BadInput where
    the map has other features.
    """

    def step(  # type: ignore[override]
        self,
        ctx: Context,
        features: SegmentHistograms,
        map: ReferenceGraph,
        candidates: Candidates | None = None,
        words: WordSimilarities | None = None,
        length_scale: LengthScale | None = None,
        last: LastView | None = None,
    ) -> ReferenceMatch.Out:
        return super().step(ctx, features, map, candidates, words, length_scale, last)

    def compare(self, map: ReferenceGraph, features: SegmentFeatures, chosen: Ints | None) -> Floats:
        return similarities(map.features, features.values, self.headings, "histograms", None, chosen)

    def exponent_and_scale(self, features: SegmentFeatures) -> tuple[float | None, float | None]:
        return 0.0, None
