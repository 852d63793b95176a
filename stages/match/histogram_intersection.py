"""Similarity as the mean intersection of the segments' histograms."""

from typing import Annotated

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.geometry.segments import similarities
from omninav.stages.values.belief import Particles
from omninav.stages.values.features import SegmentHistograms
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.reach import Reach
from omninav.stages.values.similarity import Similarities

from .candidates import check_alike, near_belief


class HistogramIntersection(Stage):
    """Similarity as the mean intersection of all segments' histograms: nothing is left out.

    The non-selective rival of Gross & Koenig 2004, section 2, over histograms. `headings`, `radius`,
    `strangers`, `whole_up_to` as in selective.py. Raises BadInput where the map was learned with other features.
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
        features: SegmentHistograms,
        map: ReferenceGraph,
        near: Particles | None = None,
        reach: Reach | None = None,
    ) -> Out:
        """Compare one view."""
        check_alike(features, map)
        metres = self.radius * (self.reach_m if reach is None else reach.metres)
        chosen, stands_for = near_belief(map.poses, near, metres, self.whole_up_to, self.strangers, ctx.tick.index)
        values = similarities(map.features, features.values, self.headings, True, False, chosen=chosen)
        return self.Out(similarities=Similarities(values, chosen, stands_for))
