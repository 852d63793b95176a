"""Similarity by the Euclidean distance of whole views."""

from omninav.pipeline import Context, Stage
from omninav.stages.geometry.appearance.segments import euclidean_similarities
from omninav.stages.values.belief import Particles
from omninav.stages.values.features import SegmentFeatures
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.similarity import Similarities

from .candidates import NearBelief, check_same_kind


class L2Match(NearBelief, Stage):
    """Similarity by the L2 norm of the whole difference vector: 1 is equal, 0 the largest possible difference.

    The non-selective method of Gross & Koenig 2004, section 2. Raises BadInput where the map has other features.
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
        kind = check_same_kind(features, map)
        chosen, sampling_weight = self.candidates(ctx, map, near, length_scale)
        values = euclidean_similarities(map.features, features.values, self.headings, kind, chosen)
        return self.Out(similarities=Similarities(values, chosen, sampling_weight))
