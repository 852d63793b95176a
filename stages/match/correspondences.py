"""Finds what of the present view is seen in another."""

from typing import Annotated, Literal

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.geometry.appearance.visual_distance import ComparisonOptions, match_patches
from omninav.stages.values.correspondences import Correspondences
from omninav.stages.values.local_features import LocalFeatures


class MatchFeatures(Stage):
    """Pairs of patches of two views: each other's nearest, clearly nearer than the second, with similar colours.

    Goedemé et al. 2007, sections 3.2 and 3.4. The first view is the present one.
    """

    ratio: Annotated[float, Bounds(gt=0, le=1)] = 0.8
    """Of a match's distance to that of the second nearest of either patch."""
    max_colour_distance: Annotated[float, Bounds(gt=0)] = 0.5
    """Between the colours of two patches (Euclidean, of three correlations)."""
    search: Literal["all", "kd_tree"] = "all"
    """Through all descriptors, or by kd-trees, which find the same pairs."""

    class Out(Outputs):
        """The pairs; there may be none."""

        correspondences: Correspondences

    def step(self, ctx: Context, features: LocalFeatures, target: LocalFeatures) -> Out:
        """Match two views."""
        options = ComparisonOptions(self.ratio, max_colour_distance=self.max_colour_distance, search=self.search)
        pairs = match_patches(features.patches(), target.patches(), options)
        return self.Out(correspondences=Correspondences(pairs.first, pairs.second, pairs.distance))
