"""Visual distance of two views, or of one and many, by what they have in common and how it is arranged."""

import math
from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from omninav.stages.geometry.arrays import Array, Floats, Ints
from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.geometry.runs import chosen_runs

from .feature_matching import (
    NO_PAIRS,
    Pairs,
    mahalanobis_matches,
    mutual_nearest,
    mutual_nearest_of_each,
    squared_distances,
    tree_matches,
)

MAX_GLOBAL_DISTANCE = 0.5
"""Largest distance between the global colours (Euclidean, three correlations) of views that are compared further."""
MIN_MATCHES = 8
"""Fewest matches of views that have something in common, unless another number is given."""
PatchDistance = Literal["euclidean", "mahalanobis"]
"""Distance of two patches' descriptors: as they are, or each element by its spread over both views (equation 2 of
Goedemé et al. 2007)."""
ROWS = 2048
"""Patches that are compared at once, and those of the view that goes beyond: their distances stay in the cache."""


class ComparisonOptions(NamedTuple):
    """Settings of the comparison of two views.

    `ratio`, `segment_ratio`: a match's distance over that of the second nearest, of patches and of vertical segments.
    `max_colour_distance`: of the colours of two matching patches (Euclidean, three correlations). `min_matches`: with
    fewer two views have nothing in common. `min_angle` (rad): the smallest mean angle between matches that counts.
    `patch_distance`: of two patches' descriptors, Euclidean or by equation 2; segments are always compared by
    equation 2. `search`: through all descriptors, or by kd-trees, which find the same.
    """

    ratio: float = 0.8
    segment_ratio: float = 0.8
    max_colour_distance: float = 0.5
    min_matches: int = MIN_MATCHES
    min_angle: float = math.radians(0.5)
    patch_distance: PatchDistance = "euclidean"
    search: Literal["all", "kd_tree"] = "all"


class Patches(NamedTuple):
    """Patches of a view: float32 `descriptors` (N, D), `colours` (N, 3), `azimuths` (N,)."""

    descriptors: Floats
    colours: Floats
    azimuths: Array


class Segments(NamedTuple):
    """Vertical segments of a view: `descriptors` (N, D), `azimuths` (N,), rad."""

    descriptors: Floats
    azimuths: Array


class ViewFeatures(NamedTuple):
    """Features that a view is compared by; None for a kind that was not looked for."""

    patches: Patches | None
    segments: Segments | None


class Comparison(NamedTuple):
    """Two views compared. `distance`: inf where too little matches. `turn` (rad): how far the second view's robot is
    turned, counter-clockwise, against the first's. `matches`; `features`: the mean number of both views' features."""

    distance: float
    turn: float
    matches: int
    features: float


def match_patches(one: Patches, other: Patches, by: ComparisonOptions) -> Pairs:
    """Patches of two views with similar descriptors and colours (Goedemé et al. 2007, sections 3.2 and 3.4)."""
    if not len(one.descriptors) or not len(other.descriptors):
        return NO_PAIRS
    if by.patch_distance == "mahalanobis":
        pairs = mahalanobis_matches(one.descriptors, other.descriptors, by.ratio, by.search)
    elif by.search == "kd_tree":
        pairs = tree_matches(one.descriptors, other.descriptors, by.ratio)
    else:
        pairs = mutual_nearest(squared_distances(one.descriptors, other.descriptors), by.ratio)
    distances = np.linalg.norm(one.colours[pairs.first] - other.colours[pairs.second], axis=1)
    return pairs.chosen(distances <= by.max_colour_distance)


def alignment(angles: Array) -> tuple[float, Array]:
    """The circular mean of angles (N,), and what is left of each after it: within pi."""
    mean = math.atan2(float(np.sin(angles).sum()), float(np.cos(angles).sum()))
    return mean, np.asarray(wrap(angles - mean), np.float64)


def local_distance(angles: Array, first: int, second: int, by: ComparisonOptions) -> tuple[float, float]:
    """Visual distance by matches, and the turn that aligns the views.

    D = (n1 + n2) sum |theta_i| / (2 N^2) (Goedemé et al. 2007, equations 3 and 4; erratum 27 in docs/papers.md): the
    mean number of features over that of matches, times the mean angle between matches once both views are aligned by
    the circular mean. The paper does not state its unit; here it is the full turn, in which 0.5 makes places of about
    the paper's size (in radians they would be a metre wide). `angles` (N,): azimuth in the second view less that in the
    first. `first`, `second`: n1 and n2. A single match would be a perfect one, so D is inf below `min_matches`, and the
    mean angle is at least `min_angle`.
    """
    number, features = len(angles), (first + second) / 2.0
    if number < max(1, by.min_matches):
        return math.inf, 0.0
    turn, left = alignment(angles)
    mean_angle = max(float(np.abs(left).mean()), by.min_angle)
    return features / number * mean_angle / (2.0 * math.pi), turn


def compare(one: ViewFeatures, other: ViewFeatures, by: ComparisonOptions, part: bool = False) -> Comparison:
    """Two views by their local features, of whichever kinds both have.

    `part`: only some features of the first view are known, those that a map keeps. The second is then counted as if it
    had as many.
    """
    angles: Array | None = None
    if one.patches is not None and other.patches is not None:
        pairs = match_patches(one.patches, other.patches, by)
        angles = other.patches.azimuths[pairs.second] - one.patches.azimuths[pairs.first]
    return compared(one, other, angles, by, part)


def compared(
    one: ViewFeatures, other: ViewFeatures, matched: Array | None, by: ComparisonOptions, part: bool = False
) -> Comparison:
    """`compare` of views whose patches match at the angles `matched` (M,); None: one of them has no patches."""
    angles, first, second = [np.empty(0)], 0, 0
    if matched is not None and one.patches is not None and other.patches is not None:
        angles.append(matched)
        first, second = len(one.patches.azimuths), len(other.patches.azimuths)
    if one.segments is not None and other.segments is not None:
        pairs = mahalanobis_matches(one.segments.descriptors, other.segments.descriptors, by.segment_ratio)
        angles.append(other.segments.azimuths[pairs.second] - one.segments.azimuths[pairs.first])
        first, second = first + len(one.segments.azimuths), second + len(other.segments.azimuths)
    differences = np.concatenate(angles)
    second = first if part else second
    distance, turn = local_distance(differences, first, second, by)
    # A robot that turned right sees the same further left.
    return Comparison(distance, -turn, len(differences), (first + second) / 2.0)


def colour_distances(one: npt.ArrayLike, other: npt.ArrayLike) -> Array:
    """Euclidean distances of global colours over the last axis (section 4.2.1)."""
    gap: Array = np.linalg.norm(np.asarray(one, np.float64) - np.asarray(other, np.float64), axis=-1)
    return gap


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
        rows, starts = chosen_runs(self._starts, chosen)
        squares = squared_distances(own.descriptors[rows], other.descriptors)
        view, first, second = mutual_nearest_of_each(squares, starts, by.ratio)
        first = rows[first]
        kept = np.linalg.norm(own.colours[first] - other.colours[second], axis=1) <= by.max_colour_distance
        angles = other.azimuths[second[kept]] - own.azimuths[first[kept]]
        return np.split(angles, np.searchsorted(view[kept], np.arange(1, len(chosen))))
