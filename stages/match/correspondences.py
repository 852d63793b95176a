"""Finds what of the present view is seen in another."""

from typing import Annotated, Literal

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.geometry.appearance.visual_distance import Matching, match_patches
from omninav.stages.values.correspondences import Correspondences
from omninav.stages.values.local_features import LocalFeatures


class MatchFeatures(Stage):
    """Pairs of patches of two views: each other's nearest, clearly nearer than the second, and of alike colours.

    Goedeme et al. 2007, sections 3.2 and 3.4. `ratio`: to the second nearest, of either. `colour`: how far apart the
    colours of two patches may lie (Euclidean, three correlations). `search`: through all, or by kd-trees, which find
    the same. The first view is the present one.
    """

    ratio: Annotated[float, Bounds(gt=0, le=1)] = 0.8
    colour: Annotated[float, Bounds(gt=0)] = 0.5
    search: Literal["all", "kd_tree"] = "all"

    class Out(Outputs):
        """The pairs; it may be none."""

        correspondences: Correspondences

    def step(self, ctx: Context, features: LocalFeatures, target: LocalFeatures) -> Out:
        """Match two views."""
        pairs = match_patches(features, target, Matching(self.ratio, colour=self.colour, search=self.search))
        return self.Out(correspondences=Correspondences(pairs.first, pairs.second, pairs.distance))
