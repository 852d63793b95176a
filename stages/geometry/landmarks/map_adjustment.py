"""Poses of a map's references, its landmarks and the camera, brought into agreement with what all images show."""

import math
from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np

from omninav.stages.geometry.arrays import Array, Floats, Ints
from omninav.stages.geometry.plane.drive_graph import odometry_sigmas
from omninav.stages.geometry.plane.image_delay import FINE_DELAY_S, RobotPath, found_delay
from omninav.stages.geometry.plane.mount import camera_poses, found_mount
from omninav.stages.geometry.plane.se2 import between, compose, distances_along, wrap

from .adjustment import Lens, Motions, adjusted
from .carried_drive import CarriedDrive, carried_drive
from .closures import FAR_M, candidate_pairs, straightened_drive, verified_pairs
from .floor import floor_depth, lowest_plane
from .map_making import MAX_DISTANCE_M, MIN_PARALLAX, LocalViews, PairMatches, fitting_matches, in_map_frame, tracks_of
from .pair_lengths import Steps, driven_steps, pair_lengths
from .tracks import Tracks, joined_matches
from .triangulation import triangulated_tracks

Seen = Callable[[Ints], Lens]
"""The lens through which features (O,), rows among all, are seen."""

SIGMA = math.radians(0.1)
"""Standard deviation of a bearing (rad)."""
MISSES = (math.radians(10.0), math.radians(1.0))
"""Angle between a bearing and its landmark above which it is left out (rad): while poses are wrong, and then."""
OFF_PLANES = (math.radians(4.0), math.radians(0.35))
"""Angle of a bearing to the plane through both cameras and the other bearing, above which a match is wrong (rad): while
poses are wrong, and then."""
MIN_FIT = 0.4
"""Part of the matches that must fit poses as they are given. In a house 0.95 fit exact ones, 0.76 those that are off by
10 cm and 2 degrees, and 0.25 the exact ones where the camera is taken for a mirrored one."""
CONTRADICTED = "what the images show contradicts the poses: check both and the camera"
"""Problem of poses that fewer matches fit."""
GIVEN_SIGMAS = (0.1, 0.1, math.radians(2.0))
"""Standard deviations of poses that are given (m, m, rad), before it is known how good they are."""
MIN_SIGMAS = (0.001, 0.001, math.radians(0.02))
"""The same at least, once it is."""
CONFIRMED_M, OUTLYING_M = 0.005, 0.02
"""Median distance by which images move poses that are exact, at most, and the distance of one that is not (m)."""
MIN_GAIN = 1.15
"""Factor by which more matches must fit adjusted poses than given ones: 1.00 where poses are exact, in a house, a store
and on grass; 1.4 in house and store, 1.07 on grass, where they are off by 2 cm and 0.4 degrees."""
MIN_SIGHTINGS, MIN_SHARE = 20, 0.5
"""Landmarks that a reference must see to tell where it is, and the part of all references that must see as many."""
SEEN_LOOSENESS = (10.0, 10.0, 3.0)
"""Factors of the standard deviations of odometry where it was seen in the images: where these show little its lengths
are off by a third and more, and it repeats what the images show."""
MIN_CLOSURES = 3
"""Pairs of images far apart along a drive that must show one place, to tell how odometry bent it."""
MOUNT_ROUNDS = 5
"""Largest number of adjustments that a mount and a delay are found from; each begins with those of the one before."""
SIGMA_FACTOR = 3.5
"""Factor of a bearing's standard deviation for the covariances of poses, as neighbouring bearings have correlated
errors: over eight development maps of odometry the geometric mean of the positions' NEES is 2.5 with it, where 2 is
right, and 10.7 without (docs/experiments/landmarks.md)."""
NORMAL_MEDIAN = 0.6745
"""Median of the absolute value of a normal variable of standard deviation 1."""

NOWHERE: Ints = np.empty(0, np.int64)


class AdjustedMap(NamedTuple):
    """Poses (R, 3) of references that agree with what their images show, and what the camera is corrected by (K,).

    `problem`: why nothing was adjusted; empty where it was. `closures`: how often a drive came back to a place.
    `scale`: factor of odometry's lengths by which the floor is where it is known to be; None where that is not known.
    `seen` (R, 3): poses as the images show them, also where those that were given are kept; None where nothing but the
    images measured any. `covariances`: a function that gives those (R, 3, 3) of the poses, 0 where images confirm given
    ones; None where nothing was adjusted. `slipped` (S,): references after which odometry had another length than the
    images show, up to the next one. `carried` (C,): references after which the robot was carried, `unseen`
    (U,): those after which only odometry tells where it went, though it should have been seen.
    """

    poses: Array
    camera: Array
    problem: str = ""
    closures: int = 0
    scale: float | None = None
    seen: Array | None = None
    covariances: Callable[[], Array] | None = None
    slipped: Ints = NOWHERE
    carried: Ints = NOWHERE
    unseen: Ints = NOWHERE


def found_with_mount(
    robot: RobotPath, described: Array, adjust: Callable[[Array], AdjustedMap], again: Callable[[Array], AdjustedMap]
) -> tuple[AdjustedMap, Array, float]:
    """Adjusts the poses of a camera on a robot, and finds its mount (3,) and the delay of its images (s).

    `described`: the mount as the camera's description states it. Where the adjusted poses show another mount or a
    delay, those that begin with them are adjusted again. `again`: adjusts poses that tell both, where those as measured
    fit nothing.
    """
    found, mount, delay = adjust(camera_poses(robot.poses, described)), described, 0.0
    for _ in range(MOUNT_ROUNDS):
        seen = (again(camera_poses(robot.before(delay), mount)) if found.problem else found).seen
        if seen is None:
            break
        later = found_delay(seen, robot)
        by = found_mount(seen, camera_poses(robot.before(later), mount), left=mount is not described)
        if by is None and abs(later - delay) < FINE_DELAY_S:
            break
        moved = mount if by is None else compose(mount, by)
        tried = adjust(camera_poses(robot.before(later), moved))
        if tried.problem and not found.problem:
            break
        found, mount, delay = tried, moved, later
    return (found, described, 0.0) if found.problem else (found, mount, delay)


def adjusted_to_given(views: LocalViews, matches: PairMatches, poses: Array, seen: Seen) -> AdjustedMap:
    """Adjust poses (R, 3) that are given, and may be exact or wrong by decimetres and degrees.

    How wrong they are is not known before: once the images were asked, each pose is held by as much as the median was
    moved, or by as much as it was itself, where that is more. Poses that images confirm as well as they can are kept
    as they were given, but for single ones that are off: images that show little bend poses and fit them no better.
    """
    sigmas, found = np.tile(GIVEN_SIGMAS, (len(poses), 1)), _Solution(poses, None)
    for miss, off_plane in zip((*MISSES, MISSES[-1]), (*OFF_PLANES, OFF_PLANES[-1]), strict=True):
        fits = fitting_matches(_looking(views, seen, found.camera), matches, found.poses, off_plane)
        if found.camera is None and len(fits) and fits.mean() < MIN_FIT:
            return AdjustedMap(poses, np.empty(0), CONTRADICTED)
        again = _bundled(views, tracks_of(views, matches, fits), found, seen, miss, sigmas, None, poses)
        if again is None:
            return AdjustedMap(poses, np.empty(0), "too few landmarks are seen")
        moved = again.poses - poses
        moved[:, 2] = wrap(moved[:, 2])
        found = again._replace(poses=poses + moved)
        moved[:, :2] = np.hypot(moved[:, 0], moved[:, 1])[:, None] / math.sqrt(2.0)
        moved = np.abs(moved)
        # The median of such a length is 0.83 sigmas, so that positions are held 1.5 times less than their own spread
        # tells: held as it tells, poses given wrong by 10 cm come out 6 % worse, with a NEES of 5.9 in place of 4.1.
        sigmas = np.maximum(np.maximum(np.median(moved, axis=0) / NORMAL_MEDIAN, MIN_SIGMAS), moved)
    assert found.camera is not None
    looking = _looking(views, seen, found.camera)
    given, agreed = (_fitting(looking, matches, each) for each in (poses, found.poses))
    away = np.hypot(*(found.poses - poses)[:, :2].T)
    confirmed = np.median(away) < CONFIRMED_M or agreed.sum() < MIN_GAIN * given.sum()
    # A single pose is off where its own matches show it by three standard deviations of their number.
    exact = confirmed & ((away < OUTLYING_M) | (agreed < MIN_GAIN * given + 3.0 * np.sqrt(given)))
    covariances = found.covariances
    assert covariances is not None

    def uncertain() -> Array:
        return np.where(exact[:, None, None], 0.0, covariances(SIGMA_FACTOR))

    kept = _wrapped(np.where(exact[:, None], poses, found.poses))
    return AdjustedMap(kept, found.camera, seen=found.poses, covariances=uncertain)


def _fitting(views: LocalViews, matches: PairMatches, poses: Array) -> Ints:
    """The number (R,) of matches that fit, of each reference."""
    fits = fitting_matches(views, matches, poses, OFF_PLANES[-1])
    both = np.concatenate([matches.first[fits], matches.second[fits]])
    return np.bincount(views.owners[both], minlength=len(views))


def odometry_motions(poses: Array, seen_motion: bool) -> Motions:
    """Motions between poses (R, 3) that odometry measured, or that were seen in the images (`seen_motion`)."""
    along, steps = np.arange(len(poses)), between(poses[:-1], poses[1:])
    looseness = np.array(SEEN_LOOSENESS) if seen_motion else np.ones(3)
    return Motions(np.column_stack([along[:-1], along[1:]]), steps, looseness * odometry_sigmas(steps))


def adjusted_drive(
    views: LocalViews,
    similarity: Iterable[Floats],
    odometry: Array,
    seen: Seen,
    height: float | None,
    rng: np.random.Generator,
    seen_motion: bool = False,
) -> AdjustedMap:
    """Adjust the poses (R, 3) of a drive that odometry alone has measured; `seen_motion`: it was seen in the images.

    Loops are closed by words and geometry, and odometry is one more measurement beside all bearings. `similarity`: row
    r is that of reference r to all (R,); `height`: of the camera over the floor (m), which gives the true scale where
    landmarks show the floor. The first reference stays. Draws from `rng`.
    """
    steps = between(odometry[:-1], odometry[1:])
    driven = distances_along(odometry)
    pairs = candidate_pairs(similarity, driven)
    verified = verified_pairs(views, pairs, rng)
    closures = int((np.abs(np.diff(driven[verified.pairs], axis=1)) > FAR_M).sum())
    if closures < MIN_CLOSURES:
        return AdjustedMap(odometry, np.empty(0), "no place that the tour came back to was recognised by its landmarks")
    sigmas = odometry_sigmas(steps)
    if seen_motion:
        measured, looseness = Steps(steps, sigmas, NOWHERE), np.array(SEEN_LOOSENESS)
    else:
        lengths = pair_lengths(views.bearings, verified, odometry)
        measured, looseness = driven_steps(steps, sigmas, verified, lengths), np.ones(3)
    straight = straightened_drive(odometry[0], measured.motions, measured.sigmas, verified)
    drive = CarriedDrive(straight, measured.motions, measured.sigmas, NOWHERE, NOWHERE)
    if not seen_motion:
        drive = carried_drive(straight, measured.motions, measured.sigmas, verified)
    order = np.argsort(verified.ratio, kind="stable")
    tracks = joined_matches(verified.first[order], verified.second[order], views.owners)
    along = np.arange(len(odometry))
    driven_motions = Motions(np.column_stack([along[:-1], along[1:]]), drive.motions, looseness * drive.sigmas)
    solution = _Solution(drive.poses, None)
    for miss in MISSES:
        refined = _bundled(views, tracks, solution, seen, miss, None, driven_motions, None)
        if refined is None:
            return AdjustedMap(odometry, np.empty(0), "too few landmarks are seen")
        solution = refined
    covariances = solution.covariances
    assert solution.camera is not None
    assert covariances is not None
    depth = None
    if height:
        seen_by = solution.references, solution.landmarks
        lowest = lowest_plane(solution.points, solution.poses, *seen_by) if seen_motion else height
        if lowest is not None:
            by = lowest / height
            depth = floor_depth(solution.points / by, solution.poses / [by, by, 1.0], *seen_by, height)
            depth = None if depth is None else depth * by
    scale = height / depth if height and depth is not None else None
    poses = solution.poses.copy()
    poses[:, :2] = poses[0, :2] + (scale or 1.0) * (poses[:, :2] - poses[0, :2])
    poses = _wrapped(poses)
    units = np.array([scale or 1.0, scale or 1.0, 1.0])
    # Motion that was seen in the images is the camera's, and tells nothing of the robot under it.
    shown = None if seen_motion else poses

    def uncertain() -> Array:
        return covariances(SIGMA_FACTOR) * np.outer(units, units)

    return AdjustedMap(
        poses, solution.camera, "", closures, scale, shown, uncertain, measured.slipped, drive.steps, drive.unseen
    )


class _Solution(NamedTuple):
    # Poses and what the camera is corrected by; the landmarks, and of each sighting its reference and its landmark; the
    # poses' covariances by the factor of a bearing's standard deviation.
    poses: Array
    camera: Array | None
    points: Array = np.empty((0, 3))
    references: Ints = np.empty(0, np.int64)
    landmarks: Ints = np.empty(0, np.int64)
    covariances: Callable[[float], Array] | None = None


def _bundled(
    views: LocalViews,
    tracks: Tracks,
    before: _Solution,
    seen: Seen,
    miss: float,
    sigmas: Array | None,
    motions: Motions | None,
    given: Array | None,
) -> _Solution | None:
    # None where too few references see enough of the landmarks.
    centres, bearings = in_map_frame(_looking(views, seen, before.camera), before.poses)
    made = triangulated_tracks(
        tracks.starts, centres[tracks.features], bearings[tracks.features], miss, MIN_PARALLAX, MAX_DISTANCE_M
    )
    there = np.isfinite(made.points[:, 0])
    kept = there[tracks.owners]  # a bearing that misses now may agree in the end
    features, landmarks = tracks.features[kept], (np.cumsum(there) - 1)[tracks.owners[kept]]
    references, lens = views.owners[features], seen(features)
    start = np.zeros(len(lens.sigmas)) if before.camera is None else before.camera
    onwards = Lens(lambda corrections: lens.bearings(start + corrections), lens.sigmas)
    out = adjusted(
        before.poses, made.points[there], references, landmarks, onwards, SIGMA, sigmas, motions, given=given
    )
    references, landmarks = references[out.inliers], landmarks[out.inliers]
    enough = np.bincount(references, minlength=len(before.poses)) >= MIN_SIGHTINGS
    if not enough.any() or enough.mean() < MIN_SHARE:
        return None
    return _Solution(out.poses, start + out.camera, out.points, references, landmarks, out.covariances)


def _looking(views: LocalViews, seen: Seen, camera: Array | None) -> LocalViews:
    if camera is None or not len(camera):
        return views
    return views.looking_along(seen(np.arange(len(views.bearings))).bearings(camera))


def _wrapped(poses: Array) -> Array:
    beyond = np.abs(poses[:, 2]) > math.pi
    poses[beyond, 2] = wrap(poses[beyond, 2])
    return poses
