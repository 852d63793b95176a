"""Motion from image to image by the bearings of points that the last keyframes have triangulated."""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from omninav.pipeline import Value
from omninav.stages.geometry.appearance.feature_matching import mutual_nearest_units
from omninav.stages.geometry.appearance.visual_words import root_descriptors
from omninav.stages.geometry.arrays import Array, Bytes, Floats, Ints
from omninav.stages.geometry.two_views.epipolar import turn_about_vertical
from omninav.stages.geometry.two_views.ransac import AgreedPose
from omninav.stages.geometry.two_views.relative_pose_ransac import Solver, false_alarms, relative_pose

from .adjustment import adjusted
from .bearing_pose import TOLERANCE, matched, pose_of_bearings
from .closures import MAX_FALSE_ALARMS, MIN_INLIERS
from .floor import lowest_plane
from .leaning_images import MAX_SHARE, leaning_images, levelled
from .map_adjustment import SIGMA
from .map_making import RATIO, LocalViews, fitting_matches, mean_descriptors, pair_matches, tracks_of, triangulated

KEYFRAMES = 6
"""Images that are kept, and adjusted together when one is added."""
MIN_POINTS, SURE_POINTS = 8, 20
"""Points that must agree on where an image was taken, and number of them below which matches of two images go first."""
MIN_LENGTHS = 4
"""Points that must agree on how far the camera moved along a direction that matches of two images tell."""
RELATIVE_SIGMA = 0.1
"""Standard deviation of that length, as a part of it."""
MIN_PARALLAX = math.radians(1.0)
"""Median angle between matched bearings, both turned the same way, from which two images tell a direction (rad)."""
MAX_SAMPLES = 1000
"""Samples of five matches that are drawn at most where an image leans."""
STILL = math.radians(0.3)
"""The same below which the camera is taken to be where the keyframe was (rad)."""
KEYFRAME_PARALLAX = math.radians(3.0)
"""The same from which an image becomes a keyframe (rad)."""


class Keyframes(Value):
    """The last keyframes of a drive: `poses` (K, 3) in a frame of their own (m, m, rad), and their features.

    `starts` (K + 1,), `bearings` (F, 3), `patches` (F, D): fields of `views`. `level` (F, 3): bearings of level
    cameras. `points` (L, 3): that they have triangulated, in that frame, with their mean `descriptors` (L, D).
    """

    poses: Array
    level: Array
    starts: Ints
    bearings: Array
    patches: Bytes
    points: Array
    descriptors: Floats

    @property
    def views(self) -> LocalViews:
        """The features."""
        return LocalViews(self.starts, self.bearings, self.patches)

    def scaled(self, factor: float) -> "Keyframes":
        """All lengths times a factor."""
        return replace(self, poses=self.poses * [factor, factor, 1.0], points=factor * self.points)


class Tracked(NamedTuple):
    """The pose of an image: `pose` (3,) in the keyframes' frame, `sigmas` (2,) of its place (m) and heading (rad).

    `parallax`: median angle by which matched bearings moved since the last keyframe (rad). `scaled`: whether the length
    of the motion is known; else it is 1, in the direction that was seen, or 0 where too little moved to tell any, and
    the place's sigma is a part of the usual length.
    """

    pose: Array
    sigmas: tuple[float, float]
    parallax: float
    scaled: bool


def begun(pose: Array, bearings: Array, descriptors: Bytes) -> Keyframes:
    """One keyframe, of whose points nothing is known."""
    starts, unknown = np.array([0, len(bearings)]), np.empty((0, descriptors.shape[1]), np.float32)
    return Keyframes(pose[None], bearings, starts, bearings, descriptors, np.empty((0, 3)), unknown)


def tracked(keyframes: Keyframes, bearings: Array, descriptors: Bytes, rng: np.random.Generator) -> Tracked | None:
    """Finds the pose of an image with these features; None where too few of them agree on one."""
    last, looks = keyframes.poses[-1], root_descriptors(descriptors)
    pairs = matched(looks, keyframes.descriptors)
    seen, points = np.ascontiguousarray(bearings[pairs.first]), keyframes.points[pairs.second]
    found, out = pose_of_bearings(seen, points, TOLERANCE, SIGMA, MIN_POINTS), None
    if found is not None:
        spread = max(found.sigma, SIGMA) * np.sqrt(np.diag(found.covariance))
        distances = np.hypot(*(points[found.inliers] - np.append(last[:2], 0.0)).T[:2])
        moved = float(np.hypot(*(found.pose - last)[:2]) / np.median(distances))
        out = Tracked(found.pose, (float(np.hypot(*spread[:2])), float(spread[2])), moved, True)
        if np.count_nonzero(found.inliers) >= SURE_POINTS:
            return out
    other = _from_last(keyframes, bearings, looks, seen, points, rng)
    return other if out is None or (other is not None and other.scaled) else out


def _from_last(
    keyframes: Keyframes, bearings: Array, looks: Floats, seen: Array, points: Array, rng: np.random.Generator
) -> Tracked | None:
    """Finds it by matches with the last keyframe, and the length by points (M, 3) `seen` (M, 3), if only a few."""
    last, rows = keyframes.poses[-1], keyframes.views.rows(len(keyframes.poses) - 1)
    pairs = mutual_nearest_units(keyframes.views.compared(rows), looks, RATIO)
    first, second = keyframes.level[rows][pairs.first], bearings[pairs.second]
    found = _relative_pose(first, second, rng) if len(first) >= MIN_INLIERS else None
    if found is None or np.count_nonzero(found[0].inliers) < MIN_INLIERS:
        return None
    pose, solver = found
    turn = math.atan2(pose.rotation[1, 0], pose.rotation[0, 0])
    level = turn_about_vertical(turn).T @ pose.rotation
    moved = _parallax(first[pose.inliers], second[pose.inliers] @ level.T, turn)
    out = np.array([last[0], last[1], last[2] + turn])
    if moved < MIN_PARALLAX:
        return Tracked(out, (moved / KEYFRAME_PARALLAX, SIGMA), moved, False)
    if false_alarms(pose, first, second, TOLERANCE, solver) > MAX_FALSE_ALARMS:
        return None
    towards = _turned(pose.translation, last[2])
    length = _length(towards, _turned(seen @ level.T, float(out[2])), points - np.append(last[:2], 0.0))
    out[:2] += (length or 1.0) * towards[:2] / np.hypot(*towards[:2])
    return Tracked(out, (RELATIVE_SIGMA * (length or 1.0), SIGMA), moved, length is not None)


def _relative_pose(first: Array, second: Array, rng: np.random.Generator) -> tuple[AgreedPose, Solver] | None:
    """The pose of an image beside a level one, and its solver: that of level images, unless it leans."""
    level = relative_pose(first, second, rng, threshold=TOLERANCE)
    agreeing = 0 if level is None else np.count_nonzero(level.inliers)
    if agreeing < MAX_SHARE * len(first):
        leaning = relative_pose(first, second, rng, "five_point", TOLERANCE, max_samples=MAX_SAMPLES)
        if leaning is not None and agreeing < MAX_SHARE * np.count_nonzero(leaning.inliers):
            return leaning, "five_point"
    return None if level is None else (level, "planar")


def _length(towards: Array, bearings: Array, points: Array) -> float | None:
    """The way along a direction (3,) after which most of a few points (M, 3) are seen along their bearings (M, 3)."""
    across = np.cross(towards, bearings)
    lengths = np.einsum("mi,mi->m", np.cross(points, bearings), across) / np.maximum((across**2).sum(axis=1), 1e-9)
    rays = points - lengths[:, None, None] * towards
    cos = np.einsum("lmi,mi->lm", rays, bearings) / np.maximum(np.linalg.norm(rays, axis=2), 1e-9)
    agree = (cos > math.cos(TOLERANCE)) & (lengths > 0.0)[:, None]
    best = agree[agree.sum(axis=1).argmax()] if len(agree) else np.empty(0)
    return float(np.median(lengths[best])) if best.sum() >= MIN_LENGTHS else None


def _turned(vectors: Array, angle: float) -> Array:
    return np.asarray(vectors @ turn_about_vertical(angle).T)


def _parallax(first: Array, second: Array, turn: float) -> float:
    """Median angle (rad) between matched bearings (M, 3) of two images, once the second is turned as the first."""
    return float(np.median(np.linalg.norm(_turned(second, turn) - first, axis=1)))


def is_keyframe(found: Tracked) -> bool:
    """Tells that an image has moved on so far that points are to be triangulated from it."""
    return found.parallax > (KEYFRAME_PARALLAX if found.scaled else MIN_PARALLAX)


def extended(keyframes: Keyframes, pose: Array, bearings: Array, descriptors: Bytes) -> tuple[Keyframes, float | None]:
    """The last keyframes and a new one, adjusted together with the points that they see; the first two stay.

    With them the depth of the floor below the camera, in their unit; None where it is not seen.
    """
    views, first = keyframes.views, max(0, len(keyframes.poses) + 1 - KEYFRAMES)
    cut = views.starts[first]
    views = LocalViews(
        np.append(views.starts[first:] - cut, len(views.bearings) - cut + len(bearings)),
        np.concatenate([views.bearings[cut:], bearings]),
        np.concatenate([views.descriptors[cut:], descriptors]),
    )
    poses = np.concatenate([keyframes.poses[first:], pose[None]])
    pairs = np.column_stack(np.triu_indices(len(poses), 1))
    matches = pair_matches(views, pairs)
    levelling = leaning_images(views, matches, poses, None, leave_shared=False)
    level = views if levelling is None else levelled(views, levelling)
    seen = triangulated(level, tracks_of(level, matches, fitting_matches(level, matches, poses)), poses)
    owners = views.owners[seen.features]
    held = np.full(poses.shape, math.inf)
    held[:2] = 0.0
    found = adjusted(poses, seen.points, owners, seen.landmarks, level.bearings[seen.features], SIGMA, held)
    right = np.bincount(seen.landmarks[found.inliers], minlength=len(seen.points)) > 1
    depth = lowest_plane(found.points, found.poses, owners, seen.landmarks)
    return Keyframes(
        found.poses, level.bearings, *views, found.points[right], mean_descriptors(views, seen)[right]
    ), depth
