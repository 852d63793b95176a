"""Similarity by the angle between whole views."""

from omninav.pipeline import Stage
from omninav.stages.geometry.appearance.segments import cosine_similarities
from omninav.stages.geometry.arrays import Floats, Ints
from omninav.stages.values.features import SegmentFeatures
from omninav.stages.values.maps import ReferenceGraph

from .reference_match import ReferenceMatch


class CosineMatch(ReferenceMatch, Stage):
    """Similarity by the cosine of the angle between whole views, as learned descriptors are compared.

    1 is the same direction; 0 a right angle or more. Raises BadInput where the map has other features.
    """

    def compare(self, map: ReferenceGraph, features: SegmentFeatures, chosen: Ints | None) -> Floats:
        return cosine_similarities(map.features, features.values, self.headings, chosen)
