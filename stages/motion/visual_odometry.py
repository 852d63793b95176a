"""Odometry from images alone, where nothing else measured the motion."""

import math
from dataclasses import field
from typing import Annotated

import numpy as np

from omninav.pipeline import BadInput, Bounds, Context, Outputs, Stage, State
from omninav.stages.camera.model import Camera
from omninav.stages.geometry.arrays import Array, Bytes
from omninav.stages.geometry.landmarks.visual_odometry import STILL, Keyframes, begun, extended, is_keyframe, tracked
from omninav.stages.geometry.plane.mount import camera_poses, robot_step
from omninav.stages.geometry.plane.se2 import between, compose
from omninav.stages.values.landmarks import LandmarkFix
from omninav.stages.values.local_features import LocalFeatures
from omninav.stages.values.pose import AssumedMotion, AssumedPose, Motion, Pose

MAX_LOST = 5
"""Images in a row that show no motion, from which on each begins again."""
SCALE_SIGMAS = (0.03, 0.5)
"""Standard deviation of a length, as a part of it: where the scale is known, and where it is a guess."""
ESTIMATES = 9
"""Estimates of the scale whose median counts."""
SURE = 0.95
"""Probability of a pose by the map's landmarks from which its distance to another one counts."""
MIN_DISTANCE_M, MAX_RATIO = 0.3, 10.0
"""Distance of two such poses at least (m), and the largest scale that it may tell."""
AGREEING, MAX_SPREAD = 3, 1.2
"""Such scales in a row that must agree before they count, and the largest ratio of two of them that do."""
MOVING, SPEED_GAIN = 0.3, 0.2
"""Part of the usual length that a motion must have to change what is usual, and by how much it does."""
UNSCALED_KEYFRAMES = 30
"""Keyframes without any estimate of the scale, after which the run says that it is not known."""


class VisualOdometryState(State):
    """The last keyframes, in a frame of their own, and where the last image was taken in it (3,).

    `odometry` (3,): the path so far. `length`: guessed lengths since the last keyframe (m), and `speed_ratio`: length
    seen over length guessed, of late. `scales` (N,): estimates of what lengths are to be multiplied by, and
    `map_scales` (M,): those of the map's landmarks, which count alone once they agree (`by_map`). `anchor` (2, 2): a
    place in the frame of the keyframes, and in the map. `lost`: images in a row without motion; `seen`: one has
    shown motion; `unscaled`: keyframes without scale.
    """

    keyframes: Keyframes = field(
        default_factory=lambda: begun(np.zeros(3), np.empty((0, 3)), np.empty((0, 0), np.uint8))
    )
    pose: Array = field(default_factory=lambda: np.zeros(3))
    odometry: Array = field(default_factory=lambda: np.zeros(3))
    length: float = 0.0
    speed_ratio: float = 1.0
    scales: Array = field(default_factory=lambda: np.empty(0))
    map_scales: Array = field(default_factory=lambda: np.empty(0))
    by_map: bool = False
    anchor: Array | None = None
    lost: int = 0
    seen: bool = False
    unscaled: int = 0


class VisualOdometry(Stage):
    """Sees the motion that a source could only guess in the bearings of points around.

    Not in the papers. An image's pose follows from points that the last keyframes have triangulated, so that lengths
    are kept from image to image, and where the camera stops or turns on the spot no motion is invented. Once the points
    have moved by a few degrees the image becomes a keyframe, and the last ones are adjusted with all that they see,
    levelled first where they lean each by themselves, as of a camera that is carried.
    The true length comes from the distance of two poses by the map's landmarks (`fix`), else from the camera's height
    over a floor that is seen; else from the guess of the source at the first motion, and the run reports it. Images
    whose motion is not seen are counted (`motion_not_seen`) and continue by the usual step with the guessed turn, as
    uncertain as a guess; the next one that is seen corrects it. Motions that were measured go through as they are.
    """

    speed_m_s: Annotated[float, Bounds(ge=0, le=100)] | None = None
    """The guessed speed as it was stated, by which a log is driven whose images show no motion from the start; null and
    0: such a log is refused if it is the first."""

    class Out(Outputs):
        """The motion that was seen, and the path that it leads along."""

        motion: Motion | None = None
        odometry: Pose | None = None

    def step(
        self,
        ctx: Context,
        features: LocalFeatures,
        camera: Camera,
        motion: Motion | None,
        odometry: Pose | None,
        state: VisualOdometryState,
        fix: LandmarkFix | None = None,
    ) -> Out:
        """See the motion to one image; `fix`: the map's pose of the image before."""
        if motion is not None and not isinstance(motion, AssumedMotion):
            return self.Out(motion=motion, odometry=odometry)
        descriptors = features.descriptors
        if motion is None:
            _begin(state, odometry, features.bearings, descriptors)
            return self.Out(odometry=odometry)
        _scale_by_map(state, fix, camera.arm)
        guess = math.hypot(motion.x, motion.y) or 4.0 * motion.sigma_m**2  # half a metre a second where speed is 0
        state.length += guess
        before, usual = state.pose, state.speed_ratio * guess
        found = tracked(state.keyframes, features.bearings, descriptors, ctx.rng)
        if found is None:
            seen = self._lost(ctx, state, motion, usual, features.bearings, descriptors)
        else:
            lost, state.lost, state.seen, state.pose = state.lost, 0, True, found.pose
            unit = 1.0 if found.scaled else state.speed_ratio * state.length
            if not found.scaled:
                last = state.keyframes.poses[-1, :2]
                away = unit * (found.pose[:2] - last)
                stood = last if lost else before[:2]
                state.pose[:2] = last + away if away.any() else stood
                unit = unit if away.any() else usual
            known = found.scaled and len(state.scales) > 0
            if is_keyframe(found):
                keyframes, depth = extended(state.keyframes, state.pose, features.bearings, descriptors)
                state.keyframes, state.pose, state.length = keyframes, keyframes.poses[-1].copy(), 0.0
                if depth is not None and camera.height and not state.by_map:
                    state.scales = np.append(state.scales, camera.height / depth)[-ESTIMATES:]
                by = _rescale(state)
                before, unit = before * by, unit * by[0]
                self._say_scale(ctx, state)
            elif not len(state.keyframes.points) and found.parallax < STILL:
                state.length = 0.0  # lengths begin where the camera moves off
            x, y, turn = robot_step(between(before, state.pose), camera.arm).tolist()
            length = math.hypot(x, y)
            if found.scaled and not lost and length > MOVING * state.speed_ratio * guess:
                state.speed_ratio += SPEED_GAIN * (length / guess - state.speed_ratio)
            sigma = math.hypot(SCALE_SIGMAS[int(not known)] * length, unit * found.sigmas[0])
            seen = AssumedMotion(x, y, turn, sigma, found.sigmas[1])
        state.odometry = compose(state.odometry, (seen.x, seen.y, seen.turn))
        return self.Out(motion=seen, odometry=AssumedPose(*state.odometry.tolist()))

    def _lost(
        self,
        ctx: Context,
        state: VisualOdometryState,
        guess: AssumedMotion,
        usual: float,
        bearings: Array,
        descriptors: Bytes,
    ) -> AssumedMotion:
        ctx.count("motion_not_seen", detail=f"image {ctx.tick.frame}: too few points agree on a motion")
        state.lost += 1
        if not (state.seen or self.speed_m_s or ctx.tick.log) and state.lost >= MAX_LOST:
            raise BadInput(
                f"no motion is seen in the first {state.lost} images, of which the last shows {len(bearings)} points; "
                "take sharper, larger or brighter images, or type speed=0.5 to guess their motion (m/s)"
            )
        seen = guess
        if state.seen:  # else as it was stated, for images that hold no points at all
            x, y = usual * math.cos(guess.turn / 2), usual * math.sin(guess.turn / 2)
            seen = AssumedMotion(x, y, guess.turn, max(usual, guess.sigma_m), guess.sigma_turn)
        state.pose, state.anchor = compose(state.pose, (seen.x, seen.y, seen.turn)), None
        if state.lost >= MAX_LOST:
            state.keyframes, state.length = begun(state.pose, bearings, descriptors), 0.0
            state.scales, state.map_scales, state.by_map = np.empty(0), np.empty(0), False
        return seen

    def _say_scale(self, ctx: Context, state: VisualOdometryState) -> None:
        if len(state.scales):
            by = "the map's landmarks" if state.by_map else "the camera's height over the floor"
            ctx.fact("scale", f"of the motion seen in the images: by {by}")
            return
        state.unscaled += 1
        ctx.fact("scale", "of the motion seen in the images: by a guess of the speed")
        if state.unscaled == UNSCALED_KEYFRAMES:
            ctx.warn(
                "the true length of the motion that is seen in the images is not known so far, as the camera's height "
                "is not known or no floor is seen: metres are a guess, and so are those of a map that is made of it; "
                "write the height (m) into its camera.yaml (height: 1.2), or type the speed at the start (speed=0.5)"
            )


def _begin(state: VisualOdometryState, odometry: Pose | None, bearings: Array, descriptors: Bytes) -> None:
    vars(state).update(vars(VisualOdometryState()))
    if odometry is not None:
        state.odometry = np.array([odometry.x, odometry.y, odometry.heading])
    state.keyframes = begun(state.pose, bearings, descriptors)


def _scale_by_map(state: VisualOdometryState, fix: LandmarkFix | None, mount: Array) -> None:
    """Compare the way since an earlier pose by the map's landmarks with that between both poses."""
    if fix is None or not len(fix) or fix.probabilities[0] < SURE:
        return
    here, there = state.pose[:2], camera_poses(fix.poses[0], mount)[:2]
    if state.anchor is None:
        state.anchor = np.array([here, there])
        return
    seen, true = np.hypot(*(np.array([here, there]) - state.anchor).T)
    if max(seen, true) < MIN_DISTANCE_M:
        return
    state.anchor = np.array([here, there])
    if min(seen, true) * MAX_RATIO < max(seen, true):  # one of both is wrong
        return
    state.map_scales = np.append(state.map_scales, true / seen)[-ESTIMATES:]
    last = state.map_scales[-AGREEING:]
    state.by_map = state.by_map or (len(last) == AGREEING and last.max() < MAX_SPREAD * last.min())
    if state.by_map:
        state.scales = state.map_scales
        _rescale(state)


def _rescale(state: VisualOdometryState) -> Array:
    """Bring the keyframes to the scale that most estimates agree on. Returns what poses (3,) are multiplied by."""
    factor = float(np.median(state.scales)) if len(state.scales) else 1.0
    state.scales, state.map_scales = state.scales / factor, state.map_scales / factor
    state.keyframes, by = state.keyframes.scaled(factor), np.array([factor, factor, 1.0])
    state.pose, state.speed_ratio = state.pose * by, state.speed_ratio * factor
    if state.anchor is not None:
        state.anchor = state.anchor * [[factor], [1.0]]
    return by
