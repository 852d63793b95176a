"""Finds what of the present view is seen in another."""

from typing import Annotated, Literal

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.geometry.appearance.feature_matching import mahalanobis_matches
from omninav.stages.geometry.appearance.visual_distance import ComparisonOptions, PatchDistance, match_patches
from omninav.stages.geometry.arrays import Array, Ints
from omninav.stages.values.correspondences import Correspondences
from omninav.stages.values.local_features import LocalFeatures


class MatchFeatures(Stage):
    """Pairs of features of two views: each other's nearest, clearly nearer than the second, patches of similar colours.

    Goedemé et al. 2007, sections 3.2 to 3.4. The first view is the present one. Where both have columns, the upper ends
    of two that match are a pair, and so are the lower ones.
    """

    ratio: Annotated[float, Bounds(gt=0, le=1)] = 0.8
    """Largest ratio of a match's distance to that of the second nearest of either patch."""
    search: Literal["all", "kd_tree"] = "all"
    """Through all descriptors, or by kd-trees, which find the same pairs."""
    patch_distance: PatchDistance = "euclidean"
    """Distance of patches' descriptors: `euclidean`, or `mahalanobis`, the paper's (section 3.4, equation 2)."""

    class Out(Outputs):
        correspondences: Correspondences

    def step(self, ctx: Context, features: LocalFeatures, target: LocalFeatures) -> Out:
        options = ComparisonOptions(self.ratio, search=self.search, patch_distance=self.patch_distance)
        pairs = match_patches(features.patches(), target.patches(), options)
        first, second, distance = column_ends(features, target, options.segment_ratio)
        return self.Out(
            correspondences=Correspondences(
                np.concatenate([pairs.first, first]),
                np.concatenate([pairs.second, second]),
                np.concatenate([pairs.distance, distance]),
            )
        )


def column_ends(one: LocalFeatures, other: LocalFeatures, ratio: float) -> tuple[Ints, Ints, Array]:
    """Pairs of ends of matching columns: rows in both views' points, and distances."""
    if one.columns is None or other.columns is None:
        return np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0)
    pairs = mahalanobis_matches(one.columns.descriptors, other.columns.descriptors, ratio)
    upper_and_lower = np.arange(2)
    first = len(one) + 2 * pairs.first[:, None] + upper_and_lower
    second = len(other) + 2 * pairs.second[:, None] + upper_and_lower
    return first.ravel(), second.ravel(), np.repeat(pairs.distance, 2)
