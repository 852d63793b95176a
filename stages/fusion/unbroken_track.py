"""Holds a belief to its track where landmarks show another place that looks the same."""

import math
from dataclasses import field

import numpy as np

from omninav.pipeline import Context, Outputs, Stage, State
from omninav.stages.camera.model import Camera
from omninav.stages.geometry.arrays import Array, Bools, Bytes
from omninav.stages.geometry.landmarks.unbroken_view import Carried, carried
from omninav.stages.geometry.plane.mount import camera_step
from omninav.stages.geometry.plane.se2 import compose, wrap
from omninav.stages.geometry.probability.particles import share_within
from omninav.stages.values.belief import Particles
from omninav.stages.values.commands import Reinitialise
from omninav.stages.values.landmarks import LandmarkFix
from omninav.stages.values.length_scale import LengthScale, metres_of
from omninav.stages.values.local_features import LocalFeatures
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import Motion
from omninav.stages.values.track import Track

NEAR = (0.3, math.radians(30.0))
"""Distance (m) and turn (rad) within which two poses are of one place: the next of shelves that look the same is 0.9 m
on. Some way after the last pose that confirmed the track, odometry may be off by as much (`DRIFT`)."""
FREQUENT = (0.6, math.radians(30.0))
"""Way (m) and turn (rad) between two images, below which different surroundings tell that the robot was carried: of
images 0.9 m apart, along shelves, up to a tenth look as if it had been; of those 0.5 m apart none of 754."""
SURE, LIKELY = 0.95, 0.5
"""Probability of a pose by landmarks from which on it confirms the belief, and from which on it counts against it."""
BELIEVED, CONTRADICTED = 0.5, 0.02
"""Share of the belief around a pose above which both agree, and below which they contradict each other."""
MAX_STEP, MAX_CONFIRMED = 2.0, 20.0
"""Largest path, in length scales, that one pose confirms; and largest confirmed path, over which contradicting poses
are left out."""
MAX_SINCE = 100.0
"""Way since the last pose that confirmed the track, in length scales, after which it is forgotten."""
DRIFT, TURN_DRIFT = 0.25, math.radians(5.0)
"""Part of the way since then by which odometry may be off, and turn by which it may be off after a metre (rad)."""


class UnbrokenTrackState(State):
    """The pose (3,) that landmarks confirmed last, carried by odometry, and the path on which they did (m), from the
    first such pose on; NaN before it.

    `since`: way since then, on which the robot may have been carried as far as `carried` and turned by `turned` (rad);
    `against`: way on which landmarks spoke against the track, and `elsewhere`: on which they confirmed another one (m).
    `bearings`
    (N, 3) and `descriptors` (N, D) are the last image's, and `moved` (3,) is the motion since.
    """

    pose: Array = field(default_factory=lambda: np.full(3, np.nan))
    confirmed: float = 0.0
    since: float = 0.0
    carried: float = 0.0
    turned: float = 0.0
    against: float = 0.0
    elsewhere: float = 0.0
    moved: Array = field(default_factory=lambda: np.zeros(3))
    bearings: Array = field(default_factory=lambda: np.empty((0, 3)))
    descriptors: Bytes = field(default_factory=lambda: np.empty((0, 0), np.uint8))

    def confirm(self, pose: Array, length: float) -> None:
        """Go on from a pose (3,) that was confirmed over a path of this length (m)."""
        self.pose, self.confirmed = pose.copy(), length
        self.since, self.carried, self.turned, self.against, self.elsewhere = 0.0, 0.0, 0.0, 0.0, 0.0

    def lose(self) -> None:
        """Forget the track; `against` it and `since` go on."""
        self.pose, self.confirmed, self.carried, self.turned = np.full(3, np.nan), 0.0, 0.0, 0.0

    def leads_to(self, pose: Array) -> bool:
        """Tells whether a robot that was on the track may be at a pose (3,) by now."""
        away, turned = pose - self.pose, abs(float(wrap(pose[2] - self.pose[2])))
        near = math.hypot(away[0], away[1]) < NEAR[0] + self.carried + DRIFT * self.since
        return near and turned < NEAR[1] + self.turned + TURN_DRIFT * self.since


class UnbrokenTrack(Stage):
    """Leaves out poses by landmarks that a robot cannot have, as it was surely elsewhere and not carried since.

    Not in the papers. A building may have two halls that look the same, of which the map shows one: each image of the
    other agrees with it, and no threshold tells. But where landmarks have confirmed the belief, and each image since
    then continues the one before as by odometry, the robot was not carried. So poses elsewhere are left out, and the
    belief's recovery particles too, until they have gone on for as long a way as the belief was confirmed. Where an
    image does not continue the one before, everything counts: a robot that was carried is found at once. Where it shows
    quite different surroundings and no sure pose confirms the track, `track` reports that the robot was carried.
    """

    class Out(Outputs):
        """Belief and fix without what the track rules out."""

        belief: Particles
        track: Track
        fix: LandmarkFix | None = None

    def step(
        self,
        ctx: Context,
        state: UnbrokenTrackState,
        belief: Particles,
        features: LocalFeatures | None,
        fix: LandmarkFix | None = None,
        motion: Motion | None = None,
        length_scale: LengthScale | None = None,
        restart: Reinitialise | None = None,
        map: ReferenceGraph | None = None,
        camera: Camera | None = None,
    ) -> Out:
        """Judge one image; `features`: of it, from which `fix` was made; `map`: tells where the camera sits."""
        unit = metres_of(length_scale)
        if motion is None or ctx.tick.first_of_log or restart is not None:
            vars(state).update(vars(UnbrokenTrackState()))
        else:
            moved = np.array([motion.x, motion.y, motion.turn])
            state.pose, state.moved = compose(state.pose, moved), compose(state.moved, moved)
            state.since += math.hypot(motion.x, motion.y)
        if state.since > MAX_SINCE * unit:
            state.lose()
        left_out, surely = np.zeros(0 if fix is None else len(fix), np.bool_), False
        if features is not None:
            landmarks = None if map is None else map.landmarks
            mount = np.zeros(3)
            if landmarks is not None and camera is not None:
                mount = landmarks.mounted(camera.mount, camera.placed)
            left_out, surely = self._judged(state, belief, features, fix, unit, mount)
        holds = state.against < state.confirmed
        if holds and belief.recovery_particles:
            belief = without_recovery(belief)
        if fix is not None and holds and left_out.any():
            fix = None if left_out.all() else fix.without(left_out)
        return self.Out(belief=belief, track=Track(holds, surely), fix=fix)

    def _judged(
        self,
        state: UnbrokenTrackState,
        belief: Particles,
        features: LocalFeatures,
        fix: LandmarkFix | None,
        unit: float,
        mount: Array,
    ) -> tuple[Bools, bool]:
        """Update the track by one image of a camera with this `mount` (3,). Returns which poses (K,) are left out, and
        whether the robot was surely carried to this image."""
        before, now, moved = (state.bearings, state.descriptors), (features.bearings, features.descriptors), state.moved
        (state.bearings, state.descriptors), state.moved = now, np.zeros(3)
        driven = math.hypot(moved[0], moved[1])
        poses = np.empty((0, 3)) if fix is None else fix.poses
        shares = np.array([share_within(belief.poses, belief.weights, pose, *NEAR) for pose in poses])
        agrees = fix is not None and len(poses) and fix.probabilities[0] >= SURE and shares[0] > BELIEVED
        if agrees and ((leads := state.leads_to(poses[0])) or not state.confirmed):
            step = min(state.since, MAX_STEP * unit) if leads else 0.0  # one pose alone is no path
            state.confirm(poses[0], min(state.confirmed + step, MAX_CONFIRMED * unit))
            return np.zeros(len(poses), np.bool_), False
        how = carried(before, now, camera_step(moved, mount)) if len(before[0]) else Carried(math.inf)
        state.carried = max(state.carried, how.at_most)
        state.turned += how.turned
        # a narrow view turns out of what it saw
        surely = how.surely and driven < FREQUENT[0] and abs(float(moved[2])) < FREQUENT[1]
        if math.isinf(state.carried):
            state.lose()
        if agrees:  # the belief gave way, and may have been right before
            state.elsewhere += driven
            if state.elsewhere >= state.confirmed:
                state.confirm(poses[0], state.elsewhere)
            return np.zeros(len(poses), np.bool_), surely
        led = np.array([state.leads_to(pose) for pose in poses], np.bool_)
        out: Bools = ~led & (shares <= CONTRADICTED)
        if fix is not None and (fix.probabilities[out] >= LIKELY).any():
            state.against += driven
        return out, surely


def without_recovery(belief: Particles) -> Particles:
    """A belief without its recovery particles, of a robot that was not carried."""
    kept = len(belief.poses) - belief.recovery_particles
    total = float(np.add.reduce(belief.weights[:kept]))
    return Particles(belief.poses[:kept], belief.weights[:kept] / total, 0) if total > 0.0 else belief
