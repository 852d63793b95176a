"""Landmarks of a drive: features of its images, matched between neighbours, joined and triangulated."""

import math
from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from omninav.stages.geometry.appearance.feature_matching import NO_PAIRS, mutual_nearest_units
from omninav.stages.geometry.appearance.visual_words import root_descriptors
from omninav.stages.geometry.arrays import Array, Bools, Bytes, Floats, Ints, Shorts
from omninav.stages.geometry.plane.mount import MEDIAN_OF_RAYLEIGH
from omninav.stages.geometry.plane.se2 import between, turned

from .tracks import Tracks, joined_matches
from .triangulation import triangulated_tracks

NEIGHBOUR_DISTANCES = (0.2, 4.0)
"""Least and largest distance of two references that are matched, in length scales of the map: nearer ones show nothing
of depths, and farther ones see little that is the same."""
NEIGHBOURS = 10
"""References that each is matched with, those that share most visual words."""
RATIO = 0.8
"""Largest ratio of a match's distance to that of the second nearest."""
MIN_MATCHES = 8
"""Matches of a pair of references below which it is left out: chance gives some."""
OFF_PLANE = math.radians(0.35)
"""Angle of a bearing to the plane through both cameras and the other bearing, above which a match is wrong (rad)."""
MISS = math.radians(0.7)
"""Angle between a bearing and its landmark above which it is left out (rad)."""
MIN_PARALLAX = math.radians(1.5)
"""Angle between two bearings of a landmark, below which its depth is not known (rad)."""
BLOCK = 10_000
"""Landmarks whose descriptors are averaged at once: those of all sightings take gigabytes."""
RECENT = 64
"""References whose descriptors are kept as they are compared: those of all take gigabytes."""
MAX_SEEN = 200
"""Landmarks of a reference, those that most references see, beyond which none is kept for its sake: more make a map
larger and a pose slower, and no better."""
MAX_DISTANCE_M = 30.0
"""Distance beyond which a landmark is not kept, m."""


class LocalViews(NamedTuple):
    """Local features of references, in one list. Of reference r the rows `starts[r]` to `starts[r + 1]` of `bearings`
    (F, 3), unit vectors in the robot's frame, and of `descriptors` (F, D) uint8."""

    starts: Ints
    bearings: Array
    descriptors: Bytes

    def __len__(self) -> int:
        return len(self.starts) - 1

    @property
    def owners(self) -> Ints:
        """The reference (F,) of each feature."""
        return np.repeat(np.arange(len(self)), np.diff(self.starts))

    def looking_along(self, bearings: Array) -> "LocalViews":
        """The same features, with other bearings (F, 3)."""
        return LocalViews(self.starts, bearings, self.descriptors)

    def rows(self, reference: int) -> slice:
        """The features of a reference."""
        return slice(int(self.starts[reference]), int(self.starts[reference + 1]))

    def compared(self, rows: slice | Ints) -> Floats:
        """Descriptors (N, D) of some features as they are compared: of length 1, four times the memory."""
        return root_descriptors(self.descriptors[rows])


class PairMatches(NamedTuple):
    """Matched features of pairs (P, 2) of references: of pair p the rows `starts[p]` to `starts[p + 1]`.

    `first`, `second` (M,): rows among all features; `ratio` (M,): the clearer, the smaller.
    """

    pairs: Ints
    starts: Ints
    first: Ints
    second: Ints
    ratio: Array


class Sightings(NamedTuple):
    """Landmarks and who sees them. `points` (L, 3), m, z above the cameras; of each sighting: `landmarks` (O,) its
    point, `features` (O,) its row among all features, ascending by landmark."""

    points: Array
    landmarks: Ints
    features: Ints


def local_views(bearings: Sequence[Array], descriptors: Sequence[Bytes]) -> LocalViews:
    """One list of the features of all references, each with bearings (N, 3) and descriptors (N, D)."""
    starts = np.cumsum([0, *(len(each) for each in bearings)], dtype=np.int64)
    rows = [each for each in descriptors if len(each)] or [np.empty((0, 128), np.uint8)]
    return LocalViews(starts, np.concatenate([np.empty((0, 3)), *bearings]), np.concatenate(rows))


def neighbouring_pairs(poses: Array, similarity: Iterable[Floats], length_scale: float) -> Ints:
    """Pairs (P, 2) of references to match, each once: the most similar ones at one of the `NEIGHBOUR_DISTANCES`.

    `similarity`: row r is the similarity (R,) of reference r to all. `length_scale`: of the map, m.
    """
    from scipy.spatial import KDTree  # slow to import, and not needed without landmarks

    tree = KDTree(poses[:, :2])
    pairs: set[tuple[int, int]] = set()
    for reference, (near, similarities) in enumerate(
        zip(tree.query_ball_point(poses[:, :2], NEIGHBOUR_DISTANCES[1] * length_scale), similarity, strict=True)
    ):
        others = np.sort(np.array(near, np.int64))
        others = others[np.hypot(*(poses[others, :2] - poses[reference, :2]).T) > NEIGHBOUR_DISTANCES[0] * length_scale]
        best = others[np.argsort(-similarities[others], kind="stable")[:NEIGHBOURS]]
        pairs.update((min(reference, other), max(reference, other)) for other in best.tolist())
    return np.array(sorted(pairs), np.int64).reshape(-1, 2)


def pair_matches(views: LocalViews, pairs: Ints) -> PairMatches:
    """Features that pairs (P, 2) of references share by their descriptors alone, of which some are wrong."""
    compared = lru_cache(RECENT)(lambda reference: views.compared(views.rows(reference)))
    found, starts = [np.empty((3, 0))], [0]
    for one, other in pairs.tolist():
        matches = mutual_nearest_units(compared(one), compared(other), RATIO)
        if len(matches.first) < MIN_MATCHES:
            matches = NO_PAIRS
        found.append(np.stack([matches.first + views.starts[one], matches.second + views.starts[other], matches.ratio]))
        starts.append(starts[-1] + len(matches.first))
    first, second, ratio = np.concatenate(found, axis=1)
    return PairMatches(pairs, np.array(starts), first.astype(np.int64), second.astype(np.int64), ratio)


def fitting_matches(views: LocalViews, matches: PairMatches, poses: Array, off_plane: float = OFF_PLANE) -> Bools:
    """Which matches (M,) fit the motion between their references to within `off_plane` (rad)."""
    fits = np.zeros(len(matches.first), np.bool_)
    for n, (one, other) in enumerate(matches.pairs.tolist()):
        rows = slice(int(matches.starts[n]), int(matches.starts[n + 1]))
        a, b = views.bearings[matches.first[rows]], views.bearings[matches.second[rows]]
        fits[rows] = fit_motion(a, b, between(poses[one], poses[other]), off_plane)
    return fits


def tracks_of(views: LocalViews, matches: PairMatches, fits: Bools) -> Tracks:
    """Tracks of features that some of the matches (M,) join."""
    order = np.flatnonzero(fits)
    order = order[np.argsort(matches.ratio[order], kind="stable")]
    return joined_matches(matches.first[order], matches.second[order], views.owners)


def in_map_frame(views: LocalViews, poses: Array) -> tuple[Array, Array]:
    """Camera centres (F, 3) and unit vectors (F, 3) in the map frame, of all features."""
    owners = views.owners
    centres = np.column_stack([poses[owners, :2], np.zeros(len(owners))])
    return centres, turned(views.bearings, poses[owners, 2])


def triangulated(views: LocalViews, tracks: Tracks, poses: Array) -> Sightings:
    """Landmarks of tracks, and the sightings that agree with them."""
    centres, bearings = in_map_frame(views, poses)
    made = triangulated_tracks(
        tracks.starts, centres[tracks.features], bearings[tracks.features], MISS, MIN_PARALLAX, MAX_DISTANCE_M
    )
    there = np.isfinite(made.points[:, 0])
    number = np.cumsum(there) - 1
    return Sightings(made.points[there], number[tracks.owners[made.kept]], tracks.features[made.kept])


def widely_seen(views: LocalViews, sightings: Sightings) -> Sightings:
    """The landmarks that are among the `MAX_SEEN` of any reference that most references see, with all sightings."""
    counts = np.bincount(sightings.landmarks, minlength=len(sightings.points))
    owners = views.owners[sightings.features]
    order = np.lexsort((sightings.landmarks, -counts[sightings.landmarks], owners))
    first = np.searchsorted(owners[order], np.arange(len(views)))
    rank = np.arange(len(order)) - first[owners[order]]
    kept = np.zeros(len(counts), np.bool_)
    kept[sightings.landmarks[order[rank < MAX_SEEN]]] = True
    seen, number = kept[sightings.landmarks], np.cumsum(kept) - 1
    return Sightings(sightings.points[kept], number[sightings.landmarks[seen]], sightings.features[seen])


def mean_descriptors(views: LocalViews, sightings: Sightings) -> Floats:
    """The mean (L, D) float32 of each landmark's descriptors, at length 1."""
    starts = np.searchsorted(sightings.landmarks, np.arange(len(sightings.points) + 1))
    means = np.empty((len(sightings.points), views.descriptors.shape[1]), np.float32)
    for low in range(0, len(means), BLOCK):
        high = min(low + BLOCK, len(means))
        features = sightings.features[starts[low] : starts[high]]
        total = np.add.reduceat(views.compared(features), starts[low:high] - starts[low], axis=0)
        means[low:high] = total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-9)
    return means


def bearing_sigma(views: LocalViews, sightings: Sightings, poses: Array) -> float:
    """Robust standard deviation (rad) of a bearing, of each of its two parts, by how sightings miss.

    A landmark of few sightings bends towards them, so their squares are divided by the freedoms that are left.
    """
    if not len(sightings.points):
        return OFF_PLANE
    centres, bearings = in_map_frame(views, poses)
    rays = sightings.points[sightings.landmarks] - centres[sightings.features]
    cos = np.einsum("ij,ij->i", rays, bearings[sightings.features]) / np.linalg.norm(rays, axis=1)
    counts = np.bincount(sightings.landmarks)
    free = (2.0 * counts - 3.0) / (2.0 * counts)
    angles = np.arccos(np.clip(cos, -1.0, 1.0)) / np.sqrt(free[sightings.landmarks])
    # Misses of a landmark's two sightings are half normal, of which this finds 81 %: with all of it poses are 1 to 3 %
    # worse, and the variance factor of left-out images makes up for the rest.
    return max(float(np.median(angles)) / MEDIAN_OF_RAYLEIGH, 1e-5)


def sightings_by_reference(views: LocalViews, sightings: Sightings) -> tuple[Ints, Shorts]:
    """Landmarks of each reference: starts (R + 1,) and the landmarks (O,)."""
    owners = views.owners[sightings.features]
    order = np.argsort(owners, kind="stable")
    counts = np.bincount(owners, minlength=len(views))
    return np.concatenate([[0], np.cumsum(counts)]), sightings.landmarks[order].astype(np.int32)


def similarity_rows(starts: Ints, words: Shorts, weights: Floats, size: int, references: Ints) -> Iterator[Floats]:
    """Similarities (R,) of each of some references to all R by their visual words, one row after the other."""
    from scipy.sparse import csr_matrix  # slow to import, and not needed without landmarks

    rows = csr_matrix((weights, words, starts), shape=(len(starts) - 1, size))
    for reference in references.tolist():
        yield np.asarray((rows @ rows[reference].toarray().T)[:, 0], np.float32)


def fit_motion(first: Array, second: Array, motion: Array, tolerance: float) -> Bools:
    """Which matched bearings (M, 3) of two images one point each may have, seen before and after a motion.

    `motion` (3,): x, y (m), turn (rad) of the second robot in the frame of the first. Both bearings are within
    `tolerance` (rad) of one plane through both cameras, and meet ahead of both.
    """
    length = math.hypot(motion[0], motion[1])
    if length == 0.0:
        return np.zeros(len(first), np.bool_)
    x, y, cos, sin = motion[0] / length, motion[1] / length, math.cos(motion[2]), math.sin(motion[2])
    (a0, a1, a2), (c0, c1, b2) = first.T, second.T
    b0, b1 = cos * c0 - sin * c1, sin * c0 + cos * c1
    n0, n1, n2 = y * b2, -x * b2, x * b1 - y * b0  # normal of the plane: t x b
    m0, m1, m2 = y * a2, -x * a2, x * a1 - y * a0  # t x a
    normal = np.sqrt(n0 * n0 + n1 * n1 + n2 * n2)
    flat = np.abs(a0 * n0 + a1 * n1 + a2 * n2) <= math.sin(tolerance) * normal
    same_side = n0 * m0 + n1 * m1 + n2 * m2 > 0.0
    ahead = a0 * x + a1 * y > b0 * x + b1 * y  # a nearer point falls back behind a robot that drives on
    return np.asarray(flat & same_side & ahead)
