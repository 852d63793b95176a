"""The share of a map's own images whose poses its landmarks give."""

import math

import numpy as np
import numpy.typing as npt

from .bearing_pose import ELSEWHERE, matched, poses_of
from .map_making import LocalViews, Sightings, sightings_by_reference

Array = npt.NDArray[np.float64]
Floats = npt.NDArray[np.float32]
Ints = npt.NDArray[np.int64]

SAMPLES = 40
"""References that are left out, evenly spaced."""
CANDIDATES = 10
"""Other references whose landmarks are looked for in the image of one that is left out."""
MIN_INLIERS = 20
"""Landmarks that must agree on a pose that is sure by itself."""


def found_rate(
    views: LocalViews, sightings: Sightings, descriptors: Floats, poses: Array, sigma: float, candidates: list[Ints]
) -> float:
    """The share of sample references whose pose the landmarks of other references give, in [0, 1].

    `descriptors` (L, D): of the landmarks; `poses` (R, 3): of the references; `sigma` (rad): of a bearing;
    `candidates`: of each of the `samples_of` references, the others to look at.
    """
    starts, seen = sightings_by_reference(views, sightings)
    samples = samples_of(len(views))
    found = 0
    for reference, others in zip(samples.tolist(), candidates, strict=True):
        rows = [seen[starts[other] : starts[other + 1]] for other in others.tolist()]
        landmarks = np.unique(np.concatenate([np.empty(0, np.int32), *rows]))
        pairs = matched(views.compared(views.rows(reference)), descriptors[landmarks])
        bearings = np.ascontiguousarray(views.bearings[views.rows(reference)][pairs.first])
        made = poses_of(bearings, sightings.points[landmarks[pairs.second]], sigma, MIN_INLIERS)
        away = made[0].pose - poses[reference] if made else np.full(3, np.inf)
        found += math.hypot(away[0], away[1]) < ELSEWHERE[0]
    return found / max(1, len(samples))


def samples_of(references: int) -> Ints:
    """The references that are left out (S,)."""
    return np.unique(np.linspace(0, references - 1, min(SAMPLES, references)).astype(np.int64))


def other_references(reference: int, similarities: Floats) -> Ints:
    """The references (C,) that are most similar to one by their words (R,), without itself."""
    order = np.argsort(-similarities, kind="stable")[: CANDIDATES + 1]
    return np.asarray(order[order != reference][:CANDIDATES], np.int64)
