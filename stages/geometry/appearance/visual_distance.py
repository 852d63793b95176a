"""How far apart two views are, by what they have in common and how it is arranged."""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.values.local_features import LocalFeatures, VerticalSegments

from .feature_matching import NO_PAIRS, Pairs, mahalanobis_matches, mutual_nearest, tree_matches

Array = npt.NDArray[np.float64]
Floats = npt.NDArray[np.float32]


class Matching(NamedTuple):
    """How features are matched. `ratio`: to the second nearest, of patches and of columns. `colour`: how far apart the
    colours of two patches may lie (Euclidean, of three correlations). `search`: through all, or by kd-trees."""

    ratio: float = 0.8
    column_ratio: float = 0.8
    colour: float = 0.5
    search: str = "all"


class Measure(NamedTuple):
    """What a visual distance is made of: the least number of matches, and the least mean angle (rad) that counts."""

    least_matches: int = 8
    least_angle: float = math.radians(0.5)


class Compared(NamedTuple):
    """Two views compared. `distance`: inf where too little matches. `turn` (rad): how far the second view's robot is
    turned, counter-clockwise, against the first's. `matches` and `of`: how many of the mean number of features."""

    distance: float
    turn: float
    matches: int
    of: float


class Ready(NamedTuple):
    """A view made ready to be compared often: its descriptors as float32, their squared lengths, and its azimuths."""

    patches: LocalFeatures | None
    columns: VerticalSegments | None
    descriptors: Floats
    squares: Floats
    azimuths: Array


def made_ready(patches: LocalFeatures | None, columns: VerticalSegments | None) -> Ready:
    """A view of whichever kinds of features there are."""
    looks = np.empty((0, 1), np.float32) if patches is None else patches.descriptors.astype(np.float32)
    around = np.empty(0) if patches is None else azimuths(patches)
    return Ready(patches, columns, looks, np.einsum("nd,nd->n", looks, looks), around)


def match_patches(one: LocalFeatures, other: LocalFeatures, by: Matching) -> Pairs:
    """Patches of two views that look alike and have alike colours (Goedeme et al. 2007, sections 3.2 and 3.4)."""
    return _matched(made_ready(one, None), made_ready(other, None), by)


def _matched(one: Ready, other: Ready, by: Matching) -> Pairs:
    if one.patches is None or other.patches is None or not len(one.patches) or not len(other.patches):
        return NO_PAIRS
    if by.search == "kd_tree":
        pairs = tree_matches(one.descriptors, other.descriptors, by.ratio)
    else:
        squares = one.descriptors @ other.descriptors.T
        squares *= -2.0
        squares += one.squares[:, None]
        squares += other.squares
        pairs = mutual_nearest(squares, by.ratio)
    apart = np.linalg.norm(one.patches.colours[pairs.first] - other.patches.colours[pairs.second], axis=1)
    return pairs.chosen(apart <= by.colour)


def match_columns(one: VerticalSegments, other: VerticalSegments, by: Matching) -> Pairs:
    """Column segments of two views that look alike (section 3.4, equation 2)."""
    return mahalanobis_matches(one.descriptors, other.descriptors, by.column_ratio)


def azimuths(features: LocalFeatures) -> Array:
    """Azimuths (N,) of patches: radians, counter-clockwise from forward."""
    around: Array = np.arctan2(features.bearings[:, 1], features.bearings[:, 0])
    return around


def alignment(angles: Array) -> tuple[float, Array]:
    """The circular mean of angles (N,), and what is left of each after it: within pi."""
    mean = math.atan2(float(np.sin(angles).sum()), float(np.cos(angles).sum()))
    return mean, np.asarray(wrap(angles - mean), np.float64)


def local_distance(angles: Array, first: int, second: int, by: Measure) -> tuple[float, float]:
    """Visual distance by matches, and the turn that aligns the views.

    D = (n1 + n2) sum |theta_i| / (2 N^2) (Goedeme et al. 2007, equations 3 and 4 as erratum 27 reads them): the mean
    number of features over that of matches, times the mean angle between matches once both views are turned alike by
    the circular mean. Its unit is not said in the paper; here it is the full turn, in which 0.5 makes places of about
    the paper's size (in radians they would be a metre wide). `angles` (N,): azimuth in the second view less that in
    the first. `first`, `second`: n1 and n2. One match would be a perfect one, so that there must be `least_matches`,
    else D is inf; and the mean angle is at least `least_angle`.
    """
    number, features = len(angles), (first + second) / 2.0
    if number < max(1, by.least_matches):
        return math.inf, 0.0
    turn, left = alignment(angles)
    apart = max(float(np.abs(left).mean()), by.least_angle)
    return features / number * apart / (2.0 * math.pi), turn


def compare(one: Ready, other: Ready, matching: Matching, measure: Measure, part: bool = False) -> Compared:
    """Two views by their local features, of whichever kinds both have.

    `part`: of the first view only a part is known, what a map keeps of it. The second is then counted as if it had
    as many features: what of that part is seen again is what can be asked.
    """
    angles, first, second = [np.empty(0)], 0, 0
    if one.patches is not None and other.patches is not None:
        pairs = _matched(one, other, matching)
        angles.append(other.azimuths[pairs.second] - one.azimuths[pairs.first])
        first, second = len(one.patches), len(other.patches)
    if one.columns is not None and other.columns is not None:
        pairs = match_columns(one.columns, other.columns, matching)
        angles.append(other.columns.azimuths[pairs.second] - one.columns.azimuths[pairs.first])
        first, second = first + len(one.columns), second + len(other.columns)
    apart = np.concatenate(angles)
    second = first if part else second
    distance, turn = local_distance(apart, first, second, measure)
    # what is seen further left stands in a view that was turned to the right
    return Compared(distance, -turn, len(apart), (first + second) / 2.0)


def colours_apart(one: npt.ArrayLike, other: npt.ArrayLike) -> Array:
    """How far global colours lie apart: Euclidean over the last axis (section 4.2.1)."""
    gap: Array = np.linalg.norm(np.asarray(one, np.float64) - np.asarray(other, np.float64), axis=-1)
    return gap
