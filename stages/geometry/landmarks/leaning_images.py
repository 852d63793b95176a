"""Roll and pitch of each image of a tour, as of a camera that is carried by hand or over rough ground."""

import math

import numpy as np

from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.plane.drive_graph import odometry_sigmas
from omninav.stages.geometry.plane.se2 import between

from .adjustment import Motions, adjusted, rotations_about
from .map_adjustment import GIVEN_SIGMAS, SIGMA
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
TILT_SIGMA = math.radians(5.0)
"""Standard deviation of roll and pitch (rad): of a camera that is carried by hand."""
MIN_TILT = math.radians(0.3)
"""Median angle between an image and the median of all, below which they are taken to be level (rad)."""
MIN_SIGHTINGS = 20
"""Fewest landmarks that tell how an image leans."""
MAX_SHARE = 0.7
"""Share of the matches within the first of `OFF_PLANES` that are within `OFF_PLANE` too, from which on images are taken
to be level: 0.47 where they lean by 0.6 degrees, 0.28 by 1.2."""


def leaning_images(
    views: LocalViews, matches: PairMatches, poses: Array, are_given: bool, leave_shared: bool
) -> Array | None:
    """Rotations (R, 3, 3) that level each reference's bearings; None where all lean alike, or none does.

    `poses` (R, 3): of the camera, about right; by odometry alone unless they `are_given`. Roll and pitch join poses and
    landmarks in the adjustment. `leave_shared`: the tilt that all images share is left in, as of a camera whose own is
    adjusted with its axis.
    """
    level, about_level = (fitting_matches(views, matches, poses, angle).sum() for angle in (OFF_PLANE, OFF_PLANES[0]))
    if level >= MAX_SHARE * about_level:
        return None
    known, looking = np.zeros(len(poses), np.bool_), views
    levelling = np.tile(np.eye(3), (len(poses), 1, 1))
    sigmas, motions = np.tile([*GIVEN_SIGMAS, TILT_SIGMA, TILT_SIGMA], (len(poses), 1)), None
    if not are_given:
        along, steps = np.arange(len(poses)), between(poses[:-1], poses[1:])
        motions = Motions(np.column_stack([along[:-1], along[1:]]), steps, odometry_sigmas(steps))
        sigmas[1:, :3] = math.inf
    for off_plane, miss in zip(OFF_PLANES, MISSES, strict=True):
        tracks = tracks_of(looking, matches, fitting_matches(looking, matches, poses, off_plane))
        centres, bearings = in_map_frame(looking, poses)
        seen = tracks.features
        made = triangulated_tracks(tracks.starts, centres[seen], bearings[seen], miss, MIN_PARALLAX, MAX_DISTANCE_M)
        references = views.owners[seen]
        level_poses = np.column_stack([poses, np.zeros((len(poses), 2))])
        out = adjusted(
            level_poses, made.points, references, tracks.owners, looking.bearings[seen], SIGMA, sigmas, motions
        )
        known = np.bincount(references[out.inliers], minlength=len(poses)) >= MIN_SIGHTINGS
        if not known.any():
            return None
        poses, tilts = out.poses[:, :3], np.where(known[:, None], out.poses[:, 3:], 0.0)
        levelling = _levelling(tilts) @ levelling
        looking = levelled(views, levelling)
    leans = np.column_stack([np.arctan2(levelling[:, 2, 1], levelling[:, 2, 2]), -np.arcsin(levelling[:, 2, 0])])
    beside = leans - np.median(leans[known], axis=0)
    if np.median(np.hypot(*beside[known].T)) < MIN_TILT:
        return None
    return np.where(known[:, None, None], _levelling(beside if leave_shared else leans), np.eye(3))


def levelled(views: LocalViews, levelling: Array) -> LocalViews:
    """The views with the bearings of each reference turned by its rotation (R, 3, 3)."""
    return views.looking_along(levelled_bearings(views.bearings, levelling[views.owners]))


def levelled_bearings(bearings: Array, levelling: Array) -> Array:
    """Bearings (F, 3), each turned by a rotation (F, 3, 3) of its own."""
    return np.asarray(np.einsum("fij,fj->fi", levelling, bearings))


def leaning_deg(levelling: Array) -> float:
    """The median angle (degrees) that rotations (R, 3, 3) level."""
    return float(np.degrees(np.arccos(np.clip(np.median(levelling[:, 2, 2]), -1.0, 1.0))))


def _levelling(tilts: Array) -> Array:
    return np.asarray(rotations_about(tilts[:, 1], 1) @ rotations_about(tilts[:, 0], 0))
