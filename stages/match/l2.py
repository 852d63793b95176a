"""Similarity by the Euclidean distance of whole views."""

from typing import Annotated

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.geometry.segments import euclidean_similarities
from omninav.stages.values.belief import Particles
from omninav.stages.values.features import SegmentFeatures
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.reach import Reach
from omninav.stages.values.similarity import Similarities

from .candidates import check_alike, near_belief


class L2Match(Stage):
    """Similarity by the L2 norm of the whole difference vector: 1 is equal, 0 the largest possible difference.

    The non-selective method of Gross & Koenig 2004, section 2. `headings`, `radius`, `strangers`, `whole_up_to` as
    in selective.py. Raises BadInput where map and view are of other kinds.
    """

    headings: Annotated[int, Bounds(ge=1)] = 36
    radius: Annotated[float, Bounds(ge=0)] = 4.5
    strangers: Annotated[int, Bounds(ge=0)] = 256
    whole_up_to: Annotated[int, Bounds(ge=0)] = 1000
    reach_m: Annotated[float, Bounds(gt=0)] = 0.5

    class Out(Outputs):
        """How alike view and references are."""

        similarities: Similarities

    def step(
        self,
        ctx: Context,
        features: SegmentFeatures,
        map: ReferenceGraph,
        near: Particles | None = None,
        reach: Reach | None = None,
    ) -> Out:
        """Compare one view."""
        histograms = check_alike(features, map)
        metres = self.radius * (self.reach_m if reach is None else reach.metres)
        chosen, stands_for = near_belief(map.poses, near, metres, self.whole_up_to, self.strangers, ctx.tick.index)
        values = euclidean_similarities(map.features, features.values, self.headings, histograms, chosen)
        return self.Out(similarities=Similarities(values, chosen, stands_for))
