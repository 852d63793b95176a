"""Similarity by the Euclidean distance of whole views."""

from typing import Annotated

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.geometry.segments import euclidean_similarities
from omninav.stages.values.belief import Particles
from omninav.stages.values.features import SegmentFeatures
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.similarity import Similarities

from .candidates import check_alike, near_belief


class L2Match(Stage):
    """Similarity by the L2 norm of the whole difference vector: 1 is equal, 0 the largest possible difference.

    The non-selective method of Gross & Koenig 2004, section 2. `headings`, `radius_m`, `whole_up_to` as in
    selective.py. Raises BadInput where map and view are of other kinds.
    """

    headings: Annotated[int, Bounds(ge=1)] = 36
    radius_m: Annotated[float, Bounds(ge=0)] = 2.0
    whole_up_to: Annotated[int, Bounds(ge=0)] = 1000

    class Out(Outputs):
        """How alike view and references are."""

        similarities: Similarities

    def step(self, ctx: Context, features: SegmentFeatures, map: ReferenceGraph, near: Particles | None = None) -> Out:
        """Compare one view."""
        histograms = check_alike(features, map)
        chosen = near_belief(map.poses, near, self.radius_m, self.whole_up_to)
        values = euclidean_similarities(map.features, features.values, self.headings, histograms, chosen)
        return self.Out(similarities=Similarities(values, chosen))
