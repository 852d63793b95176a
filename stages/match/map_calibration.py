"""Learns what a similarity shows of the place on the views of a map, each left out in turn."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from omninav.pipeline import Context
from omninav.stages.geometry.arrays import Array, Bools, Floats, Ints
from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.geometry.probability.likelihood_ratio import correlation_length, logistic_fit, standard_scores
from omninav.stages.values.calibration import SimilarityCalibration
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.maps import ReferenceGraph

Compare = Callable[[int, Ints], Floats]

IMAGES, MAX_COMPARED = 200, 1000
"""Views that are left out in turn, and with how many of a large map, evenly spread, each is compared besides those
near it."""
MIN_IMAGES = 10
SPACINGS, WRONG_DISTANCES = 1.5, 3.0
"""A reference within this many spacings of the map, or one appearance length scale, is the right place; one beyond so
many times that distance is a wrong one."""
RIGHT_TURN, WRONG_TURN = math.radians(30.0), math.radians(60.0)
"""Headings, of views compared at one only, that are the right one and a wrong one."""


def calibrated(map: ReferenceGraph, compare: Compare, length_scale_m: float) -> SimilarityCalibration | None:
    """The calibration of similarities in a finished map; None where it holds too few views that show one place.

    `compare` (view, chosen): similarities of a view of the map to the `chosen` references (C,): (C, headings). Each
    image counts the same, whatever number of right and wrong references it has.
    """
    poses = map.poses
    if len(poses) < MIN_IMAGES:
        return None
    right_distance = max(length_scale_m, SPACINGS * spacing(poses))
    left_out = np.unique(np.linspace(0, len(poses) - 1, min(IMAGES, len(poses))).astype(np.int64))
    scores, weights, right = [], [], []
    evidence, places = [], []
    for view in left_out.tolist():
        chosen, each = compared_with(poses, view, WRONG_DISTANCES * right_distance)
        score = standard_scores(compare(view, chosen), each)
        same, other = right_and_wrong(poses[view], poses[chosen], score.shape[1], right_distance)
        if not same.any() or not other.any():
            continue
        for cells, kind in ((same, True), (other, False)):
            there = score[cells].astype(np.float64)
            counted = np.broadcast_to(each[:, None], score.shape)[cells]
            scores.append(there)
            weights.append(counted / counted.sum())
            right.append(np.full(len(there), kind))
        evidence.append(float(score[same].mean()))
        places.append(poses[view])
    if len(evidence) < MIN_IMAGES:
        return None
    slope, middle = logistic_fit(np.concatenate(scores), np.concatenate(weights), np.concatenate(right))
    at = np.array(places)
    alike = np.abs(wrap(at[:, None, 2] - at[:, 2])) <= RIGHT_TURN if score.shape[1] == 1 else None
    correlation = correlation_length(np.array(evidence), at[:, :2], alike)
    return SimilarityCalibration(slope, middle, len(evidence), right_distance, correlation or right_distance)


def spacing(poses: Array) -> float:
    """Median distance (m) from a reference to the nearest one taken elsewhere."""
    from scipy.spatial import KDTree  # slow to import, and seldom needed

    places = np.unique(np.round(poses[:, :2], 6), axis=0)
    if len(places) < 2:
        return 0.0
    tree: Any = KDTree(places)
    return float(np.median(tree.query(places, k=2)[0][:, 1]))


def compared_with(poses: Array, view: int, near_m: float) -> tuple[Ints, Array]:
    """References with which a view is compared, without itself, and how many each represents: (C,), (C,).

    All, or of a large map those within `near_m` metres and an even sample of the others.
    """
    others = np.delete(np.arange(len(poses)), view)
    near = np.hypot(*(poses[others, :2] - poses[view, :2]).T) <= near_m
    far = others[~near]
    number = min(MAX_COMPARED, len(far))
    sample = far[np.linspace(0, len(far) - 1, number).astype(np.int64)] if number else far
    chosen = np.concatenate([others[near], sample])
    each = np.concatenate([np.ones(int(near.sum())), np.full(number, len(far) / max(number, 1))])
    order = np.argsort(chosen)
    return chosen[order], each[order]


def right_and_wrong(pose: Array, references: Array, headings: int, right_distance: float) -> tuple[Bools, Bools]:
    """Which cells (C, headings) of references (C, 3) are the right place of a view at a pose, and which a wrong one.

    Right: within `right_distance` metres, at the compared heading nearest to the pose's. Wrong: well beyond, at any
    heading; of views that are compared at one heading only, also any that looks another way.
    """
    far = np.hypot(*(references[:, :2] - pose[:2]).T)
    turn = wrap(pose[2] - references[:, 2])
    wrong = np.repeat((far > WRONG_DISTANCES * right_distance)[:, None], headings, axis=1)
    right = np.zeros((len(references), headings), np.bool_)
    if headings == 1:
        right[:, 0] = (far <= right_distance) & (np.abs(turn) <= RIGHT_TURN)
        wrong[:, 0] |= np.abs(turn) > WRONG_TURN
        return right, wrong
    near = np.flatnonzero(far <= right_distance)
    right[near, np.round(turn[near] / (2.0 * np.pi) * headings).astype(np.int64) % headings] = True
    return right, wrong


class MapCalibration:
    """The calibration of the map that a match compares with: made at the first image, kept for the others."""

    def __init__(self) -> None:
        self._map: ReferenceGraph | None = None
        self._length = -1
        self._found: SimilarityCalibration | None = None

    def of(
        self, ctx: Context, map: ReferenceGraph, compare: Compare, length_scale: LengthScale | None
    ) -> SimilarityCalibration | None:
        """Calibration as `calibrated` gives it; its result is in the manifest."""
        if map is not self._map or len(map) != self._length:
            self._map, self._length = map, len(map)
            found = self._found = calibrated(map, compare, 0.0 if length_scale is None else length_scale.metres)
            if found is not None:
                names = ("slope", "middle", "images", "right_distance_m", "correlation_m")
                ctx.fact("similarity_calibration", {name: round(getattr(found, name), 3) for name in names})
        return self._found
