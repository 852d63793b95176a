"""Similarity from the best segments only."""

from typing import Annotated, Literal

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.geometry.segments import EXPONENTS, similarities
from omninav.stages.values.belief import Particles
from omninav.stages.values.features import SegmentFeatures
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.reach import Reach
from omninav.stages.values.similarity import Similarities

from .candidates import check_alike, near_belief


class SelectiveMatch(Stage):
    """Similarity from the k best segments only, so that occluded ones do not count.

    Gross & Koenig 2004, section 2: S = max_k (sum of the k largest s_j) sqrt(1 / (k n)); s_j is the intersection of
    segment j's histograms, or 1 - |difference| / (sqrt(3) 255) of its colours. All k are tried (erratum 21).
    `penalty`: sqrt as in the paper; cube_root: k^-1/3 n^-2/3, which wants more segments; three_quarters: k^-3/4 n^-1/4,
    which is content with fewer; none: the mean of all.
    `headings`: how many turns of each reference are compared. `radius`: with `near` wired, references within so many
    reaches (port `reach`, else of `reach_m`) of a particle are compared, and `strangers` of the others, in turns, which
    stand for all of them; in maps of up to `whole_up_to` references all are; 0 compares all. A sensor that looks
    farther than `radius` misses some. Raises BadInput where map and view are of other kinds.
    """

    penalty: Literal["sqrt", "cube_root", "three_quarters", "none"] = "sqrt"
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
        values = similarities(
            map.features, features.values, self.headings, histograms, True, EXPONENTS[self.penalty], chosen
        )
        return self.Out(similarities=Similarities(values, chosen, stands_for))
