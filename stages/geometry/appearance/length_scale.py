"""The distance over which views stay alike: a correlation length."""

import math
from typing import Any

import numpy as np

from omninav.stages.geometry.arrays import Array, Ints
from omninav.stages.geometry.plane.se2 import wrap

from .segments import HEADINGS, FeatureKind, Rows, similarities

MAX_COMPARED, NEAREST_COMPARED = 10_000, 1000
"""References with which a sample is compared, and how many of them, in a larger map, are those nearest to it."""
SAMPLES, MIN_REFERENCES = 40, 10
"""References, spread evenly over a map, that are compared with others, and the smallest map that is measured."""
EXCESS_LEFT = 0.5
"""Share of the excess similarity that is left at the length scale."""
MAX_HEADING_DIFFERENCE = math.radians(30.0)
"""Difference of heading (rad) up to which views of one segment are compared: about half of their field of view."""


def excess_by_distance(distances: Array, similarity: Array, bins: int = 30) -> tuple[Array, Array]:
    """The excess similarity of views over their distance: bin centres (B,) in metres and means (B,).

    `distances` (samples, references): from each sample view to all references, 0 to itself; `similarity`, the same
    shape, NaN where views are not to be compared. The median over the references is a sample's background: the excess
    is (S - median) / (1 - median), 1 at its own place. Bins have equal ratios of distance and hold at
    least five pairs.
    """
    background = np.nanmedian(similarity, axis=1, keepdims=True)
    excess = ((similarity - background) / np.maximum(1.0 - background, 1e-9)).ravel()
    gaps = distances.ravel()
    compared = (gaps > 1e-6) & np.isfinite(excess)
    excess, gaps = excess[compared], gaps[compared]
    if not len(gaps):
        return np.zeros(0), np.zeros(0)
    edges = np.geomspace(max(gaps.min(), gaps.max() / 1000), gaps.max() * (1 + 1e-9), bins + 1)
    which = np.digitize(gaps, edges) - 1
    inside = (which >= 0) & (which < bins)
    counts = np.bincount(which[inside], minlength=bins)
    sums = np.bincount(which[inside], excess[inside], minlength=bins)
    full = counts >= 5
    return np.sqrt(edges[:-1] * edges[1:])[full], sums[full] / counts[full]


def compared_with(poses: Array, samples: Ints) -> Ints | None:
    """References with which each of the samples (S,) of a large map is compared: (S, C). None: with all of them.

    Those nearest to it, for the similarity over short distances, and more of them evenly over the map, for the
    background.
    """
    if len(poses) <= MAX_COMPARED:
        return None
    from scipy.spatial import KDTree  # slow to import, and seldom needed

    tree: Any = KDTree(poses[:, :2])
    near = tree.query(poses[samples, :2], k=NEAREST_COMPARED)[1]
    even = np.linspace(0, len(poses) - 1, MAX_COMPARED - NEAREST_COMPARED).astype(np.int64)
    return np.concatenate([near, np.broadcast_to(even, (len(samples), len(even)))], axis=1)


def length_scale(poses: Array, features: Rows, kind: FeatureKind) -> float | None:
    """The distance (m) at which views keep half of their excess similarity; None where none can be measured.

    `poses` (R, 3) and `features` (R, segments, bins) of a `kind`.
    """
    if len(poses) < MIN_REFERENCES:
        return None
    chosen = np.unique(np.linspace(0, len(poses) - 1, min(SAMPLES, len(poses))).astype(np.int64))
    others = compared_with(poses, chosen)
    views = features[:] if others is None else None
    similarity = np.stack(
        [
            similarities(features[rows] if views is None else views, features[n], HEADINGS, kind, None).max(axis=1)
            for n, rows in zip(chosen, chosen if others is None else others, strict=True)
        ]
    ).astype(np.float64)
    gap = poses[chosen, None] - (poses if others is None else poses[others])
    if features.shape[1] == 1:
        similarity[np.abs(wrap(gap[..., 2])) > MAX_HEADING_DIFFERENCE] = np.nan
    centres, excess = excess_by_distance(np.hypot(gap[..., 0], gap[..., 1]), similarity)
    below = np.flatnonzero(excess < EXCESS_LEFT)
    if not len(centres):
        return None
    return float(centres[below[0]] if len(below) else centres[-1])
