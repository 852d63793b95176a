"""Similarity by the angle between whole views."""

from omninav.pipeline import Context, Stage
from omninav.stages.geometry.appearance.segments import cosine_similarities
from omninav.stages.values.belief import Particles
from omninav.stages.values.features import SegmentFeatures
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.similarity import Similarities

from .candidates import NearBelief, check_same_kind


class CosineMatch(NearBelief, Stage):
    """Similarity by the cosine of the angle between whole views, as learned descriptors are compared.

    1 is the same direction; 0 a right angle or more. Raises BadInput where the map has other features.
    """

    def step(
        self,
        ctx: Context,
        features: SegmentFeatures,
        map: ReferenceGraph,
        near: Particles | None = None,
        length_scale: LengthScale | None = None,
    ) -> NearBelief.Out:
        """Compare one view."""
        check_same_kind(features, map)
        chosen, sampling_weight = self.candidates(ctx, map, near, length_scale)
        values = cosine_similarities(map.features, features.values, self.headings, chosen)
        return self.Out(similarities=Similarities(values, chosen, sampling_weight))
