"""Roll, pitch and height of each image of a tour, as of a camera carried by hand or over rough ground."""

import math
from typing import NamedTuple

import numpy as np

from omninav.stages.geometry.arrays import Array, Ints

from .adjustment import Motions, adjusted, rotations_about
from .map_adjustment import GIVEN_SIGMAS, MIN_GAIN, SIGMA
from .map_making import (
    MAX_DISTANCE_M,
    MIN_PARALLAX,
    OFF_PLANE,
    LocalViews,
    PairMatches,
    fitting_matches,
    in_map_frame,
    tracks_of,
)
from .triangulation import triangulated_tracks

OFF_PLANES = (math.radians(15.0), math.radians(2.0))
"""Angle of a bearing to the plane through both cameras and the other bearing, above which a match is wrong (rad), round
by round."""
MISSES = (math.radians(20.0), math.radians(4.0))
"""Angle between a bearing and its landmark above which it is left out (rad), round by round."""
TILT_SIGMA, HEIGHT_SIGMA_M = math.radians(5.0), 0.02
"""Standard deviations of roll and pitch (rad) and of the height (m) of a camera that is carried by hand."""
MIN_TILT, MIN_HEIGHT_M = math.radians(0.3), 0.005
"""Median angle (rad) between an image and the median of all, and median height above or below it (m), below both of
which images are taken to be level."""
MIN_SIGHTINGS = 20
"""Fewest landmarks that tell how an image leans."""
MAX_SHARE = 0.7
"""Share of the matches within the first of `OFF_PLANES` that are within `OFF_PLANE` too, from which on images are taken
to be level: 0.47 where they lean by 0.6 degrees, 0.28 by 1.2."""


class Levelling(NamedTuple):
    """Brings bearings (F, 3) to those of a level camera at the mean height.

    `rotations` (F, 3, 3): that level each one's image; `raised` (F,): height of the image over the distance of what is
    seen, by which its levelled bearing points higher from below.
    """

    rotations: Array
    raised: Array

    def of(self, features: Ints) -> "Levelling":
        """That of some of the features."""
        return Levelling(self.rotations[features], self.raised[features])

    def level(self, bearings: Array) -> Array:
        """The bearings (F, 3) of a level camera."""
        out = np.einsum("fij,fj->fi", self.rotations, bearings)
        out[:, 2] += self.raised
        return np.asarray(out / np.linalg.norm(out, axis=1, keepdims=True))

    @property
    def leaning_deg(self) -> float:
        """The median angle (degrees) by which images lean."""
        return float(np.degrees(np.arccos(np.clip(np.median(self.rotations[:, 2, 2]), -1.0, 1.0))))


def leaning_images(
    views: LocalViews, matches: PairMatches, poses: Array, motions: Motions | None, leave_shared: bool
) -> Levelling | None:
    """Finds how the image of each feature leans, and its height; None where all lean alike, or none does.

    `poses` (R, 3): of the camera, about right; `motions`: those that odometry alone measured, None where poses are
    given. Roll, pitch and height join poses and landmarks in the adjustment. `leave_shared`: the tilt that all images
    share is left in, as of a camera whose own is adjusted with its axis.
    """
    fit, about_fit = (fitting_matches(views, matches, poses, angle).sum() for angle in (OFF_PLANE, OFF_PLANES[0]))
    if fit >= MAX_SHARE * about_fit:
        return None
    looking, leans = views, np.zeros((len(poses), 3))
    sigmas = np.tile([*GIVEN_SIGMAS, TILT_SIGMA, TILT_SIGMA, HEIGHT_SIGMA_M], (len(poses), 1))
    if motions is not None:
        sigmas[1:, :3] = math.inf
    for off_plane, miss in zip(OFF_PLANES, MISSES, strict=True):
        tracks = tracks_of(looking, matches, fitting_matches(looking, matches, poses, off_plane))
        centres, bearings = in_map_frame(looking, poses)
        features = tracks.features
        made = triangulated_tracks(
            tracks.starts, centres[features], bearings[features], miss, MIN_PARALLAX, MAX_DISTANCE_M
        )
        references = views.owners[features]
        start, given = (np.column_stack([poses, each]) for each in (leans, np.zeros_like(leans)))
        out = adjusted(
            start, made.points, references, tracks.owners, views.bearings[features], SIGMA, sigmas, motions, given=given
        )
        known = np.bincount(references[out.inliers], minlength=len(poses)) >= MIN_SIGHTINGS
        if not known.any():
            return None
        poses, leans = out.poses[:, :3], np.where(known[:, None], out.poses[:, 3:], 0.0)
        away = np.full(len(views.bearings), np.nan)
        rays = out.points[tracks.owners] - np.column_stack([poses[:, :2], leans[:, 2]])[references]
        away[features[out.inliers]] = np.linalg.norm(rays[out.inliers], axis=1)
        levelling = _levelling(views, leans, away)
        looking = levelled(views, levelling)
    beside = leans - np.median(leans[known], axis=0)
    tilt, height = np.median(np.hypot(*beside[known, :2].T)), np.median(np.abs(beside[known, 2]))
    before, now = (fitting_matches(each, matches, poses, OFF_PLANE).sum() for each in (views, looking))
    if (tilt < MIN_TILT and height < MIN_HEIGHT_M) or now < MIN_GAIN * before:
        return None
    if leave_shared:
        leans[known, :2] = beside[known, :2]
        levelling = _levelling(views, leans, away)
    return levelling


def levelled(views: LocalViews, levelling: Levelling) -> LocalViews:
    """The views of a level camera."""
    return views.looking_along(levelling.level(views.bearings))


def _levelling(views: LocalViews, leans: Array, away: Array) -> Levelling:
    """By roll, pitch and height (R, 3) of each image, and the distances (F,) of what is seen, NaN for unknown."""
    owners, nearness = views.owners, 1.0 / away
    for reference in np.flatnonzero(leans[:, 2]).tolist():
        rows = views.rows(reference)
        nearness[rows] = np.nan_to_num(nearness[rows], nan=np.nanmedian(nearness[rows]))
    rotations = rotations_about(leans[:, 1], 1) @ rotations_about(leans[:, 0], 0)
    return Levelling(rotations[owners], np.where(leans[owners, 2], leans[owners, 2] * nearness, 0.0))
