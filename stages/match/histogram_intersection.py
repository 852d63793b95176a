"""Similarity as the mean intersection of the segments' histograms."""

from omninav.pipeline import Context, Stage
from omninav.stages.geometry.appearance.segments import similarities
from omninav.stages.values.belief import Particles
from omninav.stages.values.features import SegmentHistograms
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.similarity import Similarities

from .candidates import NearBelief, check_same_kind


class HistogramIntersection(NearBelief, Stage):
    """Similarity as the mean intersection of all segments' histograms; no segment is left out.

    The non-selective alternative of Gross & Koenig 2004, section 2. Raises BadInput where the map has other features.
    """

    def step(
        self,
        ctx: Context,
        features: SegmentHistograms,
        map: ReferenceGraph,
        near: Particles | None = None,
        length_scale: LengthScale | None = None,
    ) -> NearBelief.Out:
        """Compare one view."""
        check_same_kind(features, map)
        chosen, sampling_weight = self.candidates(ctx, map, near, length_scale)
        values = similarities(map.features, features.values, self.headings, True, False, chosen=chosen)
        return self.Out(similarities=Similarities(values, chosen, sampling_weight, exponent=0.0))
