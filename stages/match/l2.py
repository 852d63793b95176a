"""Similarity by the Euclidean distance of whole views."""

from omninav.pipeline import Stage
from omninav.stages.geometry.appearance.segments import euclidean_similarities, max_distance_of
from omninav.stages.geometry.arrays import Floats, Ints
from omninav.stages.values.features import SegmentFeatures
from omninav.stages.values.maps import ReferenceGraph

from .reference_match import ReferenceMatch


class L2Match(ReferenceMatch, Stage):
    """Similarity by the L2 norm of the whole difference vector: 1 is equal, 0 the largest possible difference.

    The non-selective method of Gross & Koenig 2004, section 2. Raises BadInput where the map has other features.
    """

    def compare(self, map: ReferenceGraph, features: SegmentFeatures, chosen: Ints | None) -> Floats:
        return euclidean_similarities(map.features, features.values, self.headings, features.kind, chosen)

    def exponent_and_scale(self, features: SegmentFeatures) -> tuple[None, float]:
        return None, max_distance_of(len(features.values), features.kind)
