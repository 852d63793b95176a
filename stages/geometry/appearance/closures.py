"""Pairs of views that look alike although the robot drove on between them."""

import numpy as np

from omninav.stages.geometry.arrays import Array, Floats
from omninav.stages.geometry.plane.drive_graph import Closures

from .segments import HEADINGS, FeatureKind, similarities
from .visual_compass import angle_of_peak

MIN_EXCESS = 0.7
"""Share of the similarity above the background that a closure keeps; half of it is left a length scale away."""
SAMPLES = 1000
"""References that look for another, evenly spaced over a map of more."""
MIN_GAP = 5.0
"""Way along the drive, in length scales, after which two references may close a loop."""


def closures_by_appearance(features: Floats, kind: FeatureKind, driven: Array, length_scale_m: float) -> Closures:
    """The most similar reference of each, among those at least `MIN_GAP` before or behind along the drive.

    `features` (R, segments, bins) of a `kind`; `driven` (R,): metres from the start to each. A pair counts where its
    similarity keeps `MIN_EXCESS` of what exceeds the background, the median over the map: (S - median) / (1 - median).
    """
    found: dict[tuple[int, int], float] = {}
    queries = np.unique(np.linspace(0, len(features) - 1, min(SAMPLES, len(features))).astype(np.int64))
    for one in queries.tolist():
        apart = np.flatnonzero(np.abs(driven - driven[one]) >= MIN_GAP * length_scale_m)
        if not len(apart):
            continue
        values = similarities(features, features[one], HEADINGS, kind)
        best = values.max(axis=1)
        background = float(np.median(best))
        other = int(apart[best[apart].argmax()])
        if best[other] - background < MIN_EXCESS * (1.0 - background):
            continue
        turn = angle_of_peak(values[other])  # of the robot at `one`, seen from `other`
        pair = (other, one) if other < one else (one, other)
        found.setdefault(pair, turn if other < one else -turn)
    pairs = np.array(sorted(found), np.int64).reshape(-1, 2)
    return Closures(pairs, np.array([found[one, other] for one, other in pairs.tolist()]))
