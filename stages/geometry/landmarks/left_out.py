"""A map's own images, each located by the landmarks of the others: how often one is found, and how far it is off."""

import math
from typing import NamedTuple

import numpy as np

from omninav.stages.geometry.arrays import Array, Floats, Ints
from omninav.stages.geometry.plane.se2 import wrap

from .bearing_pose import ELSEWHERE, matched, poses_of
from .map_making import MAX_DISTANCE_M, MIN_PARALLAX, MISS, LocalViews, Sightings, in_map_frame, sightings_by_reference
from .triangulation import triangulated_tracks

SAMPLES = 40
"""References that are left out, evenly spaced."""
CANDIDATES = 10
"""Other references whose landmarks are looked for in the image of one that is left out."""
NEIGHBOURS = 1
"""References before and after one on the tour that are left out with it: a later drive comes as close to few."""
MIN_INLIERS = 20
"""Landmarks that must agree on a pose that is sure by itself."""
MEDIAN_SQUARES = 2.366
"""Median of the chi-square distribution with 3 degrees of freedom."""
VARIANCE_FACTOR = 2.5
"""Default variance factor, where fewer than `MIN_FOUND` left-out images were located: typical of most maps."""
MIN_FOUND = 10
"""Located images from which on the factor is measured."""


class LeftOut(NamedTuple):
    """Errors of left-out images. `found_rate`: share of sample references whose pose the landmarks of others give, in
    [0, 1]; `variance_factor`: by which the squares of their errors exceed what independent bearings would leave, at
    least 1."""

    found_rate: float
    variance_factor: float


def left_out_poses(
    views: LocalViews, sightings: Sightings, descriptors: Floats, poses: Array, sigma: float, candidates: list[Ints]
) -> LeftOut:
    """Locates sample references by landmarks that are triangulated without them and their neighbours on the tour.

    Landmarks have errors too, from coarse textures and wrong poses of the map, and those of neighbouring landmarks are
    alike: more bearings to them do not average these out, and a pose is off by more than its bearings imply.
    Descriptors are those of all sightings, the left-out image's among them, so that rather more are found than of a
    later drive.
    `descriptors` (L, D): of the landmarks; `poses` (R, 3): of the references; `sigma` (rad): of a bearing;
    `candidates`: of each of the `samples_of` references, the others to look at.
    """
    starts, seen = sightings_by_reference(views, sightings)
    owners = views.owners[sightings.features]
    centres, bearings = in_map_frame(views, poses)
    ends = np.searchsorted(sightings.landmarks, np.arange(len(sightings.points) + 1))
    samples, squares = samples_of(len(views)), []
    for reference, others in zip(samples.tolist(), candidates, strict=True):
        far = others[np.abs(others - reference) > NEIGHBOURS].tolist()
        shown = np.unique(np.concatenate([np.empty(0, np.int32), *(seen[starts[o] : starts[o + 1]] for o in far)]))
        rows = np.concatenate([np.empty(0, np.int64), *(np.arange(ends[one], ends[one + 1]) for one in shown)])
        rows = rows[np.abs(owners[rows] - reference) > NEIGHBOURS]
        tracks = np.searchsorted(sightings.landmarks[rows], np.append(shown, len(sightings.points)))
        sighted = sightings.features[rows]
        points = triangulated_tracks(
            tracks, centres[sighted], bearings[sighted], MISS, MIN_PARALLAX, MAX_DISTANCE_M
        ).points
        known = np.isfinite(points[:, 0])
        pairs = matched(views.compared(views.rows(reference)), descriptors[shown[known]], points[known])
        own = np.ascontiguousarray(views.bearings[views.rows(reference)][pairs.first])
        made = poses_of(own, points[known][pairs.second], sigma, MIN_INLIERS)
        away = made[0].pose - poses[reference] if made else np.full(3, np.inf)
        if math.hypot(away[0], away[1]) < ELSEWHERE[0]:
            away[2] = wrap(away[2])
            squares.append(float(away @ np.linalg.solve(made[0].covariance, away)) / max(sigma, made[0].sigma) ** 2)
    enough = len(squares) >= MIN_FOUND
    factor = max(1.0, float(np.median(squares)) / MEDIAN_SQUARES) if enough else VARIANCE_FACTOR
    return LeftOut(len(squares) / max(1, len(samples)), factor)


def samples_of(references: int) -> Ints:
    """The references that are left out (S,)."""
    return np.unique(np.linspace(0, references - 1, min(SAMPLES, references)).astype(np.int64))


def other_references(reference: int, similarities: Floats) -> Ints:
    """The references (C,) that are most similar to one by their words (R,), without itself."""
    order = np.argsort(-similarities, kind="stable")[: CANDIDATES + 1]
    return np.asarray(order[order != reference][:CANDIDATES], np.int64)
