"""Pairs of views that look alike although the robot drove on between them."""

import numpy as np

from omninav.stages.geometry.arrays import Array, Floats
from omninav.stages.geometry.plane.drive_graph import Closures

from .segments import EXPONENTS, similarities
from .visual_compass import angle_of_peak


def closures_by_appearance(
    features: Floats, driven: Array, histograms: bool, scale: float, headings: int, min_excess: float, min_gap: float,
    samples: int,
) -> Closures:  # fmt: skip
    """The most similar reference of each, among those at least `min_gap` metres before or behind along the drive.

    `features` (R, segments, bins); `driven` (R,): metres from the start to each. A pair counts where its similarity
    keeps `min_excess` of what exceeds the background, the median over the map: (S - median) / (1 - median). Of more
    than `samples` references so many, evenly spaced, look for a partner.
    """
    found: dict[tuple[int, int], float] = {}
    queries = np.unique(np.linspace(0, len(features) - 1, min(samples, len(features))).astype(np.int64))
    for one in queries.tolist():
        apart = np.flatnonzero(np.abs(driven - driven[one]) >= min_gap)
        if not len(apart):
            continue
        values = similarities(features, features[one], headings, histograms, True, EXPONENTS["sqrt"], None, scale)
        best = values.max(axis=1)
        background = float(np.median(best))
        other = int(apart[best[apart].argmax()])
        if best[other] - background < min_excess * (1.0 - background):
            continue
        turn = angle_of_peak(values[other])  # of the robot at `one`, seen from `other`
        pair = (other, one) if other < one else (one, other)
        found.setdefault(pair, turn if other < one else -turn)
    pairs = np.array(sorted(found), np.int64).reshape(-1, 2)
    return Closures(pairs, np.array([found[one, other] for one, other in pairs.tolist()]))
