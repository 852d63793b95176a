"""Finds the pose of an image by the landmarks that it shows."""

import math
from collections.abc import Callable, Iterator
from dataclasses import field, replace
from typing import Annotated

import numpy as np
import numpy.typing as npt

from omninav.pipeline import BadInput, Bounds, Context, Outputs, Stage, State
from omninav.stages.camera.model import Camera
from omninav.stages.camera.self_calibration import AXIS, corrected
from omninav.stages.geometry.appearance.mirrored_patches import mirrored_sift
from omninav.stages.geometry.appearance.visual_words import root_descriptors
from omninav.stages.geometry.arrays import Array, Bytes, Ints
from omninav.stages.geometry.landmarks.bearing_pose import BearingPose, matched, poses_of
from omninav.stages.geometry.plane.mount import robot_covariances, robot_poses
from omninav.stages.geometry.plane.point_cells import distinct
from omninav.stages.geometry.plane.se2 import compose, power, turned
from omninav.stages.geometry.probability.particles import systematic
from omninav.stages.values.belief import Particles
from omninav.stages.values.landmarks import LandmarkFix, Landmarks, restored_descriptors
from omninav.stages.values.length_scale import LengthScale, metres_of
from omninav.stages.values.local_features import LocalFeatures
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import AssumedMotion, Motion
from omninav.stages.values.visual_words import VisualWords

from .axis_beside import AxisBeside
from .landmarks_shown import LandmarksShown, landmarks_to_expect
from .late_images import LateImages
from .stamp_jitter import StampJitter

WORD_REFERENCES = (10, 80)
"""References that share most words with the image, whose landmarks are looked for: at first, and where none of their
poses is likelier than not. Beside the mapped way, and in stores, the right ones are often behind the first ten."""
WORD_FEATURES = 250
"""Strongest features by whose words an image is looked up: all 500 find no more images, and take 2 ms longer."""
BELIEF_SAMPLES = 5
"""Particles, drawn evenly by weight, around which references are candidates too."""
NEAR_EACH = 2
"""References that are candidates around each of them."""
SECTOR = math.radians(15.0)
"""Width of a sector of the view (rad)."""
ODDS_PER_SECTOR, EVEN_SECTORS, MAX_LOG_ODDS = 0.75, 7.5, 8.0
"""Log odds (nats) that a pose is right, by the sectors in which landmarks agree: what misleads is one wall or one shelf
that repeats itself, so that of 40 landmarks that agree on a wrong pose all are in three to seven sectors of 24, and 16
that agree on a right one in seven to ten (docs/experiments/landmarks.md)."""
SIGMA_FLOOR = (0.0003, 0.0003, math.radians(0.003))
"""Standard deviations below which no pose is taken to be known (m, m, rad)."""
SURE = 0.95
"""Probability of a pose from which on it tells how much stamps jitter."""
SAID_JITTER_S, SAID_PROBABILITY = 0.025, 0.95
"""Standard deviation of stamps (s) and its probability from which on the run reports it: in sound drives up to 0.018 is
found, since odometry is interpolated, or 0.028 with a probability of 0.8 for some images."""
STANDING = (0.01, math.radians(1.0))
"""Largest motion (m, rad) since the last image of a robot that stands, and sees the errors of landmarks again."""
MIN_IMAGES = 25.0
"""Images from which on the run reports that the axis is beside its description: the first show it too near."""
MAX_MOTIONS = 5.0
"""Largest delay of images, in intervals between two: the motion over a shorter interval is mostly noise."""
WITHOUT_LANDMARKS = (
    "the map was saved without landmarks, so that images are compared as a whole, to decimetres: "
    "learn it again from its tour with landmarks=sift, or type landmarks=none"
)
"""Warning of a run whose map has none."""


class LandmarkPoseState(State):
    """Stamp of the last image (ns), landmarks that the drive shows, likelihoods of how much stamps jitter, the axis and
    the delay of its images; `told…`: whether the run reported each."""

    stamp: int = 0
    shown: LandmarksShown = field(default_factory=LandmarksShown)
    jitter: StampJitter = field(default_factory=StampJitter.unknown)
    told: bool = False
    axis: AxisBeside = field(default_factory=AxisBeside)
    told_axis: bool = False
    late: LateImages = field(default_factory=LateImages)
    told_late: bool = False


class LandmarkPose(Stage):
    """Gives the poses from which an image may have been taken, with covariances, from bearings of known landmarks.

    Candidates are the references that share most visual words with the image, over the whole map, and those near the
    belief, both always: a belief may be wrong, and words may be ambiguous. Where they show no likely pose, more
    references are looked at, and the likelier round counts. Features are matched with the landmarks that
    candidates see; the absolute pose with most inliers is refined on a floor. What is left over is searched for a rival
    elsewhere, since wrong matches agree with each other in places that repeat themselves. A pose is the surer, the more
    sectors of the view its inliers are in, and the less sure, the fewer they are than references near it see: furniture
    that looks alike shows a tenth. An image with too few inliers gives no pose, and so does a map without
    landmarks. Where the tour, or the drive itself, showed that images are stamped late, the pose is moved on by the
    robot's motion over that time; where stamps jitter, its covariance allows for the motion over their standard
    deviation. Raises BadInput for features of another kind than the map's.
    """

    min_inliers: Annotated[int, Bounds(ge=4)] = 8
    """Smallest number of landmarks that agree on a pose (inliers). A pose with few of them has a low probability, and
    counts only near the belief."""

    class Out(Outputs):
        """Poses of the image; absent where too few landmarks agree on one."""

        fix: LandmarkFix | None = None

    def step(
        self,
        ctx: Context,
        state: LandmarkPoseState,
        features: LocalFeatures,
        map: ReferenceGraph,
        near: Particles | None = None,
        camera: Camera | None = None,
        motion: Motion | None = None,
        length_scale: LengthScale | None = None,
    ) -> Out:
        """Find the pose of the robot that took one image; `motion`: since the last one."""
        seconds, state.stamp = (ctx.tick.stamp - state.stamp) / 1e9, ctx.tick.stamp
        if ctx.tick.first_of_log:
            state.jitter, state.told, state.shown = StampJitter.unknown(), False, LandmarksShown()
            state.axis, state.told_axis = AxisBeside(), False
            state.late, state.told_late = LateImages(), False
        jitter, state.jitter = state.jitter, state.jitter.interrupted()
        measured = motion is not None and seconds > 0.0 and not isinstance(motion, AssumedMotion)
        if motion is not None and measured:
            state.late = state.late.driven(motion.turn, seconds)
        else:
            state.late = state.late.interrupted()
        landmarks = map.landmarks
        if landmarks is None:
            ctx.warn(WITHOUT_LANDMARKS)
        if landmarks is None or not len(landmarks) or len(features) < self.min_inliers:
            return self.Out()
        if features.descriptors.shape[1] != landmarks.descriptors.shape[1]:
            raise BadInput(
                f"landmarks: the map's have descriptors of {landmarks.descriptors.shape[1]} numbers, the image's have "
                f"{features.descriptors.shape[1]}; use the features the map was learned with, or learn it again"
            )
        mount = np.zeros(3) if camera is None else landmarks.mounted(camera.mount, camera.placed)

        def expected(camera_poses: Array) -> Array:
            return landmarks_to_expect(landmarks, map.poses, robot_poses(camera_poses, mount), metres_of(length_scale))

        looks = features.descriptors
        if landmarks.mirrored not in (None, features.mirrored):
            looks = mirrored_sift(looks)
        descriptors = root_descriptors(looks)
        bearings = state.axis.bearings(camera, features.points, features.bearings)
        best: LandmarkFix | None = None
        seen, points = np.empty(0, np.int64), np.empty((0, 3))
        for candidates in self._candidates(looks, landmarks.words, map, near):
            rows = landmarks.seen_by(candidates)
            known = landmarks.points[rows].astype(np.float64)
            pairs = matched(descriptors, restored_descriptors(landmarks.descriptors[rows]), known)
            known = known[pairs.second]
            fix = self._fix(bearings[pairs.first], known, landmarks, state.shown, expected)
            if fix is not None and (best is None or fix.probabilities[0] > best.probabilities[0]):
                best, seen, points = fix, pairs.first, known
            if best is not None and best.probabilities[0] > 0.5:
                break
        if best is None:
            return self.Out()
        state.shown = state.shown.seen(best.inliers[:1], expected(best.poses[:1]), float(best.probabilities[0]))
        if camera is None:
            return self.Out(fix=best)
        stands = motion is not None and math.hypot(motion.x, motion.y) < STANDING[0] and abs(motion.turn) < STANDING[1]
        if best.probabilities[0] >= SURE and not stands:
            agreed = best.agree == 0
            at = seen[agreed]
            variance = landmarks.variance_factor * landmarks.sigma_rad**2
            state.axis = state.axis.seen(
                camera, features.points[at], features.bearings[at], points[agreed], best.poses[0], variance
            )
            self._say_axis(ctx, state, camera)
        covariances = robot_covariances(best.covariances, best.poses, mount)
        poses = robot_poses(best.poses, mount)
        late = self._late_by(ctx, state, landmarks.late_by(camera.delay), camera, best, float(poses[0, 2]))
        if motion is None or seconds <= 0.0:
            return self.Out(fix=replace(best, poses=poses, covariances=covariances))
        moved = np.array([motion.x, motion.y, motion.turn])
        if late:
            poses = compose(poses, power(moved, min(max(late / seconds, -MAX_MOTIONS), MAX_MOTIONS)))
        if not isinstance(motion, AssumedMotion):  # seen motion has the same stamps
            if best.probabilities[0] >= SURE:
                jitter = state.jitter = jitter.seen(poses[0], covariances[0], moved, seconds)
            variance = jitter.variance()
            if variance > 0.0:
                self._say_jitter(ctx, state, math.sqrt(variance))
                along = turned(np.broadcast_to(moved, poses.shape), poses[:, 2] - 0.5 * moved[2])
                motions = min(variance / seconds**2, MAX_MOTIONS**2)
                covariances = covariances + motions * along[:, :, None] * along[:, None, :]
        return self.Out(fix=replace(best, poses=poses, covariances=covariances))

    def _say_axis(self, ctx: Context, state: LandmarkPoseState, camera: Camera) -> None:
        if state.told_axis or state.axis.images < MIN_IMAGES or not (beside := state.axis.distance()).any():
            return
        state.told_axis = True
        moved = corrected(camera, AXIS, beside)
        at = ", ".join(f"{getattr(moved, name):.1f}" for name in AXIS)
        ctx.warn(
            f"the camera's axis is {math.hypot(*beside):.1f} px beside where camera.yaml has it, at {at}, as the map's "
            "landmarks show: their poses allow for it, colours do not; put it into camera.yaml"
        )

    def _late_by(
        self, ctx: Context, state: LandmarkPoseState, by_map: float, camera: Camera, fix: LandmarkFix, heading: float
    ) -> float:
        # By the drive itself as soon as it shows another delay than the map.
        so_far = state.late.allowed(by_map)
        if fix.probabilities[0] >= SURE:
            state.late = state.late.seen(heading, so_far)
        late = state.late.allowed(by_map)
        if late != so_far and not state.told_late:
            state.told_late = True
            ctx.warn(
                f"images are stamped about {late:+.2f} s after they are taken, as turns by the map's landmarks and by "
                "odometry show: their poses allow for it, colours do not; put "
                f"`delay: {(camera.delay or 0.0) + late:.2f}` into camera.yaml"
            )
        return late

    def _say_jitter(self, ctx: Context, state: LandmarkPoseState, sigma: float) -> None:
        if sigma < SAID_JITTER_S or state.told or state.jitter.probability() < SAID_PROBABILITY:
            return
        state.told = True
        ctx.warn(
            f"images are some {1e3 * sigma:.0f} ms off odometry, each by itself, for which covariances allow: their "
            "time stamps jitter, or odometry comes too seldom; stamp images when they are taken"
        )

    def _fix(
        self,
        bearings: Array,
        points: Array,
        landmarks: Landmarks,
        shown: LandmarksShown,
        expected: Callable[[Array], Array],
    ) -> LandmarkFix | None:
        found = poses_of(bearings, points, landmarks.sigma_rad, self.min_inliers)
        if not found:
            return None
        sectors = np.array([sectors_of(bearings[each.inliers]) for each in found])
        inliers = np.array([int(each.inliers.sum()) for each in found], np.int64)
        poses = np.array([each.pose for each in found])
        log_odds = log_odds_of(sectors) + shown.log_odds(inliers, expected(poses))
        order = np.argsort(-log_odds, kind="stable")
        found = [found[row] for row in order]
        return LandmarkFix(
            poses[order],
            np.array([covariance_of(each, landmarks.sigma_rad, landmarks.variance_factor) for each in found]),
            inliers[order],
            probabilities_of(log_odds[order]),
            len(points),
            bearings.astype(np.float32),
            agreeing(found),
        )

    def _candidates(
        self, looks: Bytes, words: VisualWords, map: ReferenceGraph, near: Particles | None
    ) -> Iterator[Ints]:
        """References to look for landmarks in, and more of them if those were not enough."""
        similarities = words.similarities(looks[:WORD_FEATURES])
        best = np.argsort(-similarities, kind="stable") if similarities.any() else np.empty(0, np.int64)
        closest = np.empty(0, np.int64)
        if near is not None:
            places = near.poses[systematic(near.weights, BELIEF_SAMPLES, 0.5)]
            gaps = ((map.poses[: len(words), None, :2] - places[:, :2]) ** 2).sum(axis=2)
            closest = np.argpartition(gaps, min(NEAR_EACH, len(gaps)) - 1, axis=0)[:NEAR_EACH].ravel()
        first, more = WORD_REFERENCES
        yield distinct(np.concatenate([best[:first], closest]))
        if len(best) > first:
            yield distinct(np.concatenate([best[:more], closest]))


def agreeing(poses: list[BearingPose]) -> npt.NDArray[np.int8]:
    """The pose (M,) that each match agrees with, -1 for none."""
    agree = np.full(len(poses[0].inliers), -1, np.int8)
    for number, pose in enumerate(poses):
        agree[pose.inliers] = number
    return agree


def covariance_of(pose: BearingPose, sigma: float, factor: float) -> Array:
    """Covariance (3, 3) of a pose from bearings of this standard deviation (rad), times the map's variance factor."""
    variance = factor * max(sigma, pose.sigma) ** 2
    return np.asarray(variance * pose.covariance + np.diag(np.square(SIGMA_FLOOR)))


def sectors_of(bearings: Array) -> int:
    """The number of sectors of the view in which some bearings (M, 3) are."""
    return len(distinct(np.floor(np.arctan2(bearings[:, 1], bearings[:, 0]) / SECTOR).astype(np.int64)))


def log_odds_of(sectors: Ints) -> Array:
    """Log odds (K,) that a pose is right whose landmarks are in that many sectors of the view (K,), even at
    `EVEN_SECTORS`."""
    return np.asarray(np.minimum(ODDS_PER_SECTOR * (sectors - EVEN_SECTORS), MAX_LOG_ODDS))


def probabilities_of(log_odds: Array) -> Array:
    """Probabilities (K,) that each of rival poses is right, of their log odds (K,) against all of them being wrong."""
    odds = np.exp(log_odds)
    return np.asarray(odds / (1.0 + odds.sum()))
