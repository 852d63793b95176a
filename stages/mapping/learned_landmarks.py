"""Learns the landmarks of a map from the local features of its references."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from omninav.pipeline import Context, Metrics, MetricSpec, Outputs, Stage, Tick, counted
from omninav.stages.camera.model import Camera
from omninav.stages.geometry.appearance.length_scale import length_scale
from omninav.stages.geometry.arrays import Array, Floats, Ints
from omninav.stages.geometry.landmarks import map_making
from omninav.stages.geometry.landmarks.leaning_images import MIN_TILT, leaning_images, levelled
from omninav.stages.geometry.landmarks.left_out import left_out_poses, other_references, samples_of
from omninav.stages.geometry.landmarks.map_adjustment import (
    CONTRADICTED,
    AdjustedMap,
    Seen,
    adjusted_drive,
    adjusted_to_given,
    found_with_mount,
    odometry_motions,
)
from omninav.stages.geometry.landmarks.map_making import LocalViews, PairMatches
from omninav.stages.geometry.plane.image_delay import RobotPath, found_delay
from omninav.stages.geometry.plane.mount import camera_poses, robot_covariances, robot_poses
from omninav.stages.geometry.plane.se2 import compose
from omninav.stages.values.landmarks import Landmarks, stored_descriptors
from omninav.stages.values.length_scale import DEFAULT_M
from omninav.stages.values.local_features import LocalFeatures
from omninav.stages.values.maps import ReferenceEvent, ReferenceGraph
from omninav.stages.values.own_body import OwnBody, references_without_body
from omninav.stages.values.pose import Pose
from omninav.stages.values.visual_words import VisualWords

from .camera_check import CAMERA_SPECS, CameraCheck

SPECS = {
    "landmarks.number": MetricSpec(title="Landmarks", context=True),
    "landmarks.sightings": MetricSpec(title="References that see a landmark, mean", context=True),
    "landmarks.sigma_deg": MetricSpec(title="Standard deviation of a bearing", unit="deg", context=True),
    "landmarks.found_rate": MetricSpec(title="Map's own images found by landmarks", unit="%", context=True),
    "landmarks.variance_factor": MetricSpec(title="Errors of poses squared, over what bearings say", context=True),
    "landmarks.pose_sigma_m": MetricSpec(title="Standard deviation of the map's own poses, median", context=True),
    "landmarks.moved_median_m": MetricSpec(title="References moved by, median", context=True),
    "landmarks.moved_max_m": MetricSpec(title="References moved by, largest", context=True),
    **CAMERA_SPECS,
}


class LearnLandmarks(Stage):
    """Triangulates the points that several references of a map see, and adjusts the references' poses to them.

    Neighbouring references that share visual words are matched by their local features; matches that fit the motion
    between both join to tracks, and tracks become points with a mean descriptor (RootSIFT). Poses, points and, with
    `camera` wired, the camera's axis, tilt and mount are adjusted together: given poses may be exact or off by
    decimetres and degrees; those of odometry alone are straightened first by the places that the tour came back to, and
    scaled by the camera's height over the floor, which then replaces what was straightened by appearance. Images that
    lean each by themselves, as of a camera that is carried, are levelled and brought to one height first (fact
    `leaning_images`). Where too little is seen the poses stay. Manifest fact `map_adjusted`. A camera that is not as
    described is reported, and kept with the landmarks; points are those of a level camera, and poses those of the robot
    under it.
    There are none where images are too small for local features, and the map is used without them.
    """

    class Out(Outputs):
        """The map with its landmarks."""

        map: ReferenceGraph
        metrics: Metrics

    def step(
        self,
        ctx: Context,
        features: Sequence[LocalFeatures | None],
        events: Sequence[ReferenceEvent | None],
        map: ReferenceGraph,
        words: VisualWords,
        body: Sequence[OwnBody | None] = (),
        as_driven: ReferenceGraph | None = None,
        camera: Camera | None = None,
        ticks: Sequence[Tick] = (),
        odometry: Sequence[Pose | None] = (),
        truth: Sequence[Pose | None] = (),
    ) -> Out:
        """The whole tour at once; `events`: which of its images became references; `as_driven`: the map before it was
        straightened. `ticks`, `odometry` and `truth` of all images tell how late these are stamped."""
        ctx.status("triangulating landmarks")
        kept_features = references_without_body(features, events, body)
        views, given = _views(kept_features), map.pose_source == "truth"
        check = CameraCheck.of(camera, kept_features, views.bearings, given)
        described = np.zeros(3) if camera is None else camera.mount
        mounted = np.zeros(3) if camera is None else camera.arm
        described_delay = 0.0 if camera is None else camera.delay or 0.0
        tour = _Tour(views, map, words, check.seen, None if camera is None else camera.height, ctx.rng)
        adjust = tour.as_given if given else tour.as_a_drive
        measured = map.poses if given or as_driven is None else as_driven.poses
        about = camera_poses(measured, mounted)
        motions = None if given else odometry_motions(about, tour.saw_motion)
        levelling = leaning_images(views, tour.matched(about), about, motions, check.camera is not None)
        # Images from other heights alone stay: levelled, a map of images alone was worse (252 mm in place of 99).
        if levelling is not None and levelling.leaning_deg >= math.degrees(MIN_TILT):
            check = check._replace(levelling=levelling)
            views = tour.views = levelled(views, levelling)
            tour.seen = check.seen
            ctx.fact("leaning_images", f"by {levelling.leaning_deg:.1f} degrees in the median: landmarks allow for it")
        if camera is None:
            adjusted, mount, late = adjust(measured), mounted, 0.0
        else:
            robot = _robot(measured, events, ticks, truth if given else odometry)
            if given and found_delay(measured, _robot(None, events, ticks, odometry)):
                robot = RobotPath(measured)  # true poses that are late themselves tell nothing of the images
            adjusted, mount, late = found_with_mount(robot, mounted, adjust, tour.as_a_drive)
        turn = np.array([0.0, 0.0, check.yaw_beside(adjusted.camera)])
        mount = compose(mount, turn)
        poses = camera_poses(map.poses, mount) if adjusted.problem else camera_poses(adjusted.poses, turn)
        matches = tour.matched(poses) if tour.matches is None or not given else tour.matches
        views = check.levelled(views, adjusted.camera)
        tracks = map_making.tracks_of(views, matches, map_making.fitting_matches(views, matches, poses))
        sightings = map_making.widely_seen(views, map_making.triangulated(views, tracks, poses))
        starts, seen = map_making.sightings_by_reference(views, sightings)
        sigma = map_making.bearing_sigma(views, sightings, poses)
        looks = map_making.mean_descriptors(views, sightings)
        left_out = left_out_poses(views, sightings, looks, poses, sigma, _candidates(words))
        landmarks = Landmarks(
            sightings.points,
            stored_descriptors(looks),
            starts,
            seen,
            sigma,
            words,
            left_out.found_rate,
            # Poses as they came: those adjusted to a wrong horizon were bent by it.
            check.told(ctx, camera, adjusted.camera, mount - mounted, late)
            or check.elevations_told(ctx, camera, views, matches, camera_poses(map.poses, mount)),
            left_out.variance_factor,
            described,
            mount + described * [0.0, 0.0, 1.0],
            described_delay,
            described_delay + late,
            _sigmas(adjusted, poses, mount),
            any(each.mirrored for each in kept_features if each is not None),
        )
        ctx.fact("landmarks", len(landmarks))
        if not len(landmarks):
            seen_features = np.median([0 if each is None else len(each) for each in kept_features] or [0])
            ctx.warn(
                f"the tour shows no landmarks: {counted(len(map), 'image')} with {seen_features:.0f} features in the "
                "median; it is dark or blurred, has one image, or stands still"
            )
        if len(adjusted.slipped):
            ctx.warn(_slipped(adjusted, map.poses if as_driven is None else as_driven.poses))
        for after, is_shown in ((adjusted.carried, True), (adjusted.unseen, False)):
            if len(after):
                ctx.warn(_carried(after, is_shown, events, ticks))
        poses = robot_poses(poses, mount)
        moved = np.hypot(*(poses - map.poses)[:, :2].T)
        if adjusted.problem == CONTRADICTED:
            ctx.warn(f"mapping: {CONTRADICTED}; the poses stay as they were given")
        ctx.fact("map_adjusted", _words(adjusted, float(moved.max(initial=0.0)), given))
        values = {
            "number": len(landmarks),
            "sightings": len(seen) / max(1, len(landmarks)),
            "sigma_deg": float(np.degrees(sigma)),
            "found_rate": left_out.found_rate,
            "variance_factor": left_out.variance_factor,
        }
        if landmarks.pose_sigmas is not None and landmarks.pose_sigmas.any():
            values["pose_sigma_m"] = float(np.median(np.hypot(*landmarks.pose_sigmas[:, :2].T)))
        if not adjusted.problem:
            values |= {"moved_median_m": float(np.median(moved)), "moved_max_m": float(moved.max())}
        metrics = Metrics({"landmarks": values, **check.metrics(adjusted.camera, mount - mounted, late)}, SPECS)
        return self.Out(map=replace(map, poses=poses, landmarks=landmarks), metrics=metrics)


@dataclass
class _Tour:
    """Adjusts poses of a tour's references, whose `height` over the floor (m) may be known, to what they show."""

    views: LocalViews
    map: ReferenceGraph
    words: VisualWords
    seen: Seen
    height: float | None
    rng: np.random.Generator
    matches: PairMatches | None = None
    """Matches of neighbours by the poses that were last asked for."""

    @property
    def saw_motion(self) -> bool:
        """Tells whether odometry is what the images showed."""
        return self.map.pose_source == "guess"

    def matched(self, poses: Array) -> PairMatches:
        """Matches of references that are neighbours by their poses (R, 3)."""
        unit = length_scale(poses, self.map.features, self.map.kind) or DEFAULT_M
        pairs = map_making.neighbouring_pairs(poses, _rows(self.words), unit)
        if self.matches is None or not np.array_equal(pairs, self.matches.pairs):
            self.matches = map_making.pair_matches(self.views, pairs)
        return self.matches

    def as_given(self, poses: Array) -> AdjustedMap:
        """Adjust poses (R, 3) that may be exact."""
        return adjusted_to_given(self.views, self.matched(poses), poses, self.seen)

    def as_a_drive(self, poses: Array) -> AdjustedMap:
        """Adjust poses (R, 3) that odometry has measured."""
        return adjusted_drive(self.views, _rows(self.words), poses, self.seen, self.height, self.rng, self.saw_motion)


def _robot(
    measured: Array | None,
    events: Sequence[ReferenceEvent | None],
    ticks: Sequence[Tick],
    driven: Sequence[Pose | None],
) -> RobotPath:
    """The robot's path with its `measured` poses (R, 3) at references, by default those of the path itself.

    Of a tour of several logs, or one with images whose pose was not measured, the references' poses alone are given.
    """
    times = np.array([tick.stamp for tick in ticks], np.int64) / 1e9
    whole = len(driven) == len(ticks) == len(events) and None not in driven and not any(tick.log for tick in ticks)
    if not whole or not (np.diff(times) > 0.0).all():
        return RobotPath(np.empty((0, 3)) if measured is None else measured)
    poses = np.array([(pose.x, pose.y, pose.heading) for pose in driven if pose is not None])
    taken = [event is not None for event in events]
    return RobotPath(poses[taken] if measured is None else measured, times[taken], poses, times)


def _slipped(adjusted: AdjustedMap, odometry: Array) -> str:
    """The sentence on a tour whose odometry (R, 3) slipped: of the longest such stretch."""
    stretch = max(np.split(adjusted.slipped, np.flatnonzero(np.diff(adjusted.slipped) > 1) + 1), key=len)
    steps = (np.hypot(*(poses[stretch + 1] - poses[stretch])[:, :2].T) for poses in (adjusted.poses, odometry))
    seen, driven = (float(each.sum()) for each in steps)
    seen /= adjusted.scale or 1.0
    return (
        f"the tour's odometry has another length than its images show between references {stretch[0]} and "
        f"{stretch[-1] + 1}: {driven:.2f} m in place of {seen:.2f}, as of wheels that slip; the map "
        "has what the images show"
    )


def _carried(after: Ints, is_shown: bool, events: Sequence[ReferenceEvent | None], ticks: Sequence[Tick]) -> str:
    """The warning that the robot was carried in the tour after some references or, unless `is_shown`, may have been."""
    first = int(after[0])
    rows = [row for row, event in enumerate(events) if event is not None][first : first + 2]
    when = f" ({_clock(ticks, rows[0])} to {_clock(ticks, rows[1])})" if len(ticks) == len(events) else ""
    more = f", and {counted(len(after) - 1, 'time')} more" if len(after) > 1 else ""
    between_them = f"in the tour between references {first} and {first + 1}{when}{more}: their images share nothing"
    if is_shown:
        contradicted = "odometry contradicts where the rest shows them; the map has what the images show"
        return f"the robot was carried {between_them}, and {contradicted}"
    return (
        f"the robot may have been carried {between_them}, though odometry has them side by side; the map follows "
        "odometry there, and is wrong if it was"
    )


def _clock(ticks: Sequence[Tick], row: int) -> str:
    return f"{(ticks[row].stamp - ticks[0].stamp) / 1e9:.1f} s"


def _sigmas(adjusted: AdjustedMap, poses: Array, mount: Array) -> Array | None:
    """Standard deviations (R, 3) of the robot's poses, of those (R, 3) of its camera; None where none was adjusted."""
    if adjusted.covariances is None:
        return None
    covariances = robot_covariances(adjusted.covariances(), poses, mount)
    variances = np.maximum(np.diagonal(covariances, axis1=1, axis2=2), 0.0)  # rounding may leave less
    return np.asarray(np.sqrt(variances))


def _candidates(words: VisualWords) -> list[Ints]:
    samples = samples_of(len(words))
    rows = map_making.similarity_rows(words.starts, words.words, words.weights, len(words.centres), samples)
    return [other_references(int(reference), row) for reference, row in zip(samples, rows, strict=True)]


def _views(found: Sequence[LocalFeatures | None]) -> LocalViews:
    bearings = [np.empty((0, 3)) if each is None else each.bearings for each in found]
    return map_making.local_views(bearings, [each.descriptors for each in found if each is not None])


def _rows(words: VisualWords) -> Iterator[Floats]:
    return map_making.similarity_rows(
        words.starts, words.words, words.weights, len(words.centres), np.arange(len(words))
    )


def _words(adjusted: AdjustedMap, moved: float, given: bool) -> str:
    if adjusted.problem:
        return f"no: {adjusted.problem}"
    if given and moved == 0.0:
        return "no: the images confirm the poses that were given"
    if given:
        return f"poses and landmarks together, by {moved:.3f} m at most"
    scale = "odometry's scale, as the camera's height over the floor is not known or the floor not seen"
    if adjusted.scale is not None:
        scale = f"odometry's lengths times {adjusted.scale:.3f} by the camera's height over the floor"
    return f"by landmarks, with {adjusted.closures} pairs of images of one place, {moved:.2f} m at most; {scale}"
