"""Similarity of the best segments only."""

from typing import Annotated, Literal

from omninav.pipeline import Bounds, Stage
from omninav.stages.geometry.appearance.segments import EXPONENTS, MAX_COLOUR_DISTANCE, MAX_DISTANCES, similarities
from omninav.stages.geometry.arrays import Floats, Ints
from omninav.stages.values.features import SegmentFeatures
from omninav.stages.values.maps import ReferenceGraph

from .reference_match import ReferenceMatch


class SelectiveMatch(ReferenceMatch, Stage):
    """Similarity of the k best segments only, so that occluded ones do not count.

    Gross & Koenig 2004, section 2: S = max_k (sum of the k largest s_j) sqrt(1 / (k n)) over all k (erratum 21 in
    docs/papers.md); s_j is the intersection of segment j's histograms. The paper gives s_j for histograms only; for
    colours it is 1 - |difference| / `colour_scale`, not below 0, and for descriptors 1 - |difference| / 2. Raises
    BadInput where the map has other features.
    """

    penalty: Literal["sqrt", "cube_root", "three_quarters", "none"] = "sqrt"
    """Penalty on the number of segments: `sqrt` (the paper's), `cube_root` (k^-1/3 n^-2/3, wants more segments),
    `three_quarters` (k^-3/4 n^-1/4, wants fewer), or `none` (the mean of all)."""
    colour_scale: Annotated[float, Bounds(gt=0)] = MAX_COLOUR_DISTANCE
    """Difference of mean colours (blue-green-red, 0..255) at which segments have similarity 0; by default the largest
    possible, sqrt(3) 255, which leaves no segment out (docs/experiments/omniview_mcl_segments.md)."""

    def compare(self, map: ReferenceGraph, features: SegmentFeatures, chosen: Ints | None) -> Floats:
        exponent, scale = self.exponent_and_scale(features)
        return similarities(map.features, features.values, self.headings, features.kind, exponent, chosen, scale)

    def exponent_and_scale(self, features: SegmentFeatures) -> tuple[float, float]:
        kind = features.kind
        return EXPONENTS[self.penalty], self.colour_scale if kind == "colours" else MAX_DISTANCES[kind]
