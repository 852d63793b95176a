"""One view compared with many: a few large products of matrices in place of many small ones."""

from collections.abc import Sequence

import numpy as np

from omninav.stages.geometry.arrays import Array, Ints

from .feature_matching import mutual_nearest_of_each, squared_distances
from .visual_distance import Comparison, ComparisonOptions, Patches, ViewFeatures, compare, compared

ROWS = 2048
"""Patches that are compared at once, and those of the view that goes beyond: their distances stay in the cache."""


class ManyViews:
    """Views prepared to be compared with one view after the other."""

    def __init__(self, features: Sequence[ViewFeatures]) -> None:
        self.features = features
        patches = [view.patches for view in features if view.patches is not None]
        self._patches: Patches | None = None
        if patches and len(patches) == len(features):
            self._patches = Patches(*(np.concatenate(parts) for parts in zip(*patches, strict=True)))
        self._starts = np.cumsum([0, *(len(each.azimuths) for each in patches)])

    def compare(self, chosen: Ints, other: ViewFeatures, by: ComparisonOptions) -> list[Comparison]:
        """`visual_distance.compare` of the chosen views (K,) with another: the same numbers."""
        if self._patches is None or other.patches is None:
            return [compared(self.features[n], other, None, by) for n in chosen]
        if by.patch_distance == "mahalanobis":  # each two views have spreads of their own
            return [compare(self.features[n], other, by) for n in chosen]
        rows_before = np.cumsum(self._starts[chosen + 1] - self._starts[chosen])
        found: list[Comparison] = []
        for number in np.unique(rows_before // ROWS):
            block = chosen[rows_before // ROWS == number]
            angles = self._angles(block, self._patches, other.patches, by)
            found += [compared(self.features[n], other, each, by) for n, each in zip(block, angles, strict=True)]
        return found

    def _angles(self, chosen: Ints, own: Patches, other: Patches, by: ComparisonOptions) -> list[Array]:
        """Turns of the patches of each chosen view against those that they match, the clearest first."""
        rows = np.concatenate([np.arange(self._starts[n], self._starts[n + 1]) for n in chosen])
        squares = squared_distances(own.descriptors[rows], other.descriptors)
        starts = np.cumsum([0, *(self._starts[chosen + 1] - self._starts[chosen])])
        view, first, second = mutual_nearest_of_each(squares, starts, by.ratio)
        first = rows[first]
        kept = np.linalg.norm(own.colours[first] - other.colours[second], axis=1) <= by.max_colour_distance
        angles = other.azimuths[second[kept]] - own.azimuths[first[kept]]
        return np.split(angles, np.searchsorted(view[kept], np.arange(1, len(chosen))))
