"""Drives where the homing vector points, as fast as is safe."""

import math
from typing import Annotated, Literal

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage, State, Tick
from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.values.command import Command
from omninav.stages.values.homing import DrivingStatus, HomingVector, PathProgress
from omninav.stages.values.scan import Scan

from .clearance import LOOKAHEAD_M, REACTION_S, free_ahead, free_direction, stopping_speed

NARROW_MARGIN, NARROW_SPEED = 0.2, 0.5
"""Shares of the margin and of the speed with which the robot passes where there is no room for all of the margin."""
SLOW_RATIO = 0.3
"""Share of the way to the last view at which a robot that knows no metres begins to slow down."""
HEADING_GAIN = 1.5
"""Angular speed over the angle that is left, 1/s."""
APPROACH_GAIN = 0.7
"""Largest speed over the metres that are left to the last view, 1/s."""
MIN_SPEED = 0.05
"""Smallest speed close to the last view, m/s."""
TURN_IN_PLACE_DEG = 35.0
"""Angle beyond which the robot turns on the spot, degrees."""
STOP_DISTANCE_M = 0.15
"""Free distance straight ahead at which the robot stops, metres."""
BLOCKED_AFTER_S = 2.0
"""Time for which the robot waits for a free direction, or continues towards a lost target, seconds."""
WANDER_AFTER_S = 5.0
"""Time after which a robot whose target is lost wanders, seconds."""
DOUBTFUL_S, DOUBTFUL_SPEED = 5.0, 0.5
"""Time for which the robot drives towards a doubtful target, seconds, and the share of its speed with which it does."""


class FollowHomingState(State):
    """Since when (ns) targets have been lost or doubtful, and since when no direction has been free; None: not now.

    `sought_since` (ns): the same as `lost_since` of the target with the number `target` alone. `targeted` (ns): when
    there was a target last. `ranged`: whether there has been a scan, and `free`: metres free ahead as it leads to
    expect.
    """

    lost_since: int | None = None
    blocked_since: int | None = None
    target: int = -1
    sought_since: int | None = None
    targeted: int = 0
    ranged: bool = False
    free: float = math.inf


class FollowHoming(Stage):
    """Turns towards the homing vector and drives around obstacles; docks at the last view.

    Goedemé et al. 2007, section 7.2.4. Without a `scan` nothing is taken to be in the way; a robot that has had one
    stops until there is another. A lost target is approached for a while where its distance in metres is known, and a
    doubtful one slowly, since more of it is seen from closer by. Then the robot is `lost` until it is sure of its
    target: it stops, or searches, if `wander` is wired: it drives by that command, and again for a while towards what
    may be its target. After `search_s` without a break it stops. It is `blocked` where no direction is free, or where
    `stalled` is set. `status` gives the reason.
    """

    max_speed: Annotated[float, Bounds(gt=0)] = 0.4
    """m/s."""
    max_angular_speed: Annotated[float, Bounds(gt=0)] = 0.8
    """rad/s."""
    deceleration: Annotated[float, Bounds(gt=0)] = 0.5
    """m/s^2, with which it brakes: it drives no faster than it can stop within what is free ahead."""
    robot_radius_m: Annotated[float, Bounds(gt=0)] = 0.25
    """Radius of the robot's body."""
    margin_m: Annotated[float, Bounds(ge=0)] = 0.1
    """Room that the robot keeps on both sides; where that leaves no way, a fifth of it at half the speed."""
    search_s: Annotated[float, Bounds(gt=0)] = 60.0
    """Time without a break for which a target may be lost or doubtful; then the robot stops, until it is sure of it
    again or has another."""

    class Out(Outputs):
        command: Command
        status: DrivingStatus

    def step(
        self,
        ctx: Context,
        state: FollowHomingState,
        tick: Tick,
        vector: HomingVector | None = None,
        progress: PathProgress | None = None,
        scan: Scan | None = None,
        stalled: DrivingStatus | None = None,
        wander: Command | None = None,
    ) -> Out:
        idle = tick.stamp - state.targeted > BLOCKED_AFTER_S * 1e9  # what it waited for is long over
        if idle or tick.first_of_log:  # its clock may be behind that of the one before
            state.lost_since = state.blocked_since = state.sought_since = None
        if progress is not None and progress.arrived:
            return self._stand("arrived", "")
        if vector is None:
            return self._stand("waiting", "there is no target")
        state.targeted = tick.stamp
        state.lost_since, lost_s = _since(state.lost_since, not vector.is_found, tick)
        if vector.number != state.target:
            state.target, state.sought_since = vector.number, None
        state.sought_since, sought_s = _since(state.sought_since, not vector.is_found, tick)
        if sought_s >= self.search_s:
            ctx.count("gave_up")
            return self._stand("lost", f"the target was not seen in {self.search_s:g} s: {vector.why}")
        if not self._approaches(vector, lost_s, sought_s):
            if wander is not None and lost_s >= WANDER_AFTER_S:
                ctx.count("wandered_lost")
                command = Command(min(wander.speed, self.max_speed), wander.turning)
                return self.Out(command=command, status=DrivingStatus("lost", f"it wanders: {vector.why}"))
            ctx.count("stood_lost")
            return self._stand("lost", vector.why)
        moving = DrivingStatus("driving")
        if sought_s >= DOUBTFUL_S:  # a planner that waits for the target must not begin to wait again
            moving = DrivingStatus("lost", f"it drives towards what may be its target: {vector.why}")
        elif progress is not None and progress.docking:
            return self.Out(command=Command(0.0, self._turn(vector.turn)), status=DrivingStatus("docking"))
        if stalled is not None:
            ctx.count("stood_blocked")
            return self._stand("blocked", stalled.why)
        state.ranged |= scan is not None
        if state.ranged and scan is None:
            ctx.count("stood_without_scan")
            return self._stand(moving.state, "its range finder is silent: waiting for a scan")
        left = _metres_left(vector, scan)
        direction, speed = self._free_direction(vector, scan, left)
        state.blocked_since, blocked_s = _since(state.blocked_since, direction is None, tick)
        if direction is None:
            if blocked_s < BLOCKED_AFTER_S:  # somebody may be passing by
                why = "waiting for a way through"
                return self._stand(moving.state, f"{moving.why}; {why}" if moving.why else why)
            ctx.count("stood_blocked")
            return self._stand("blocked", f"nothing is free for {LOOKAHEAD_M:g} m towards the target")
        if abs(direction) > math.radians(TURN_IN_PLACE_DEG):
            return self.Out(command=Command(0.0, self._turn(direction)), status=moving)
        speed *= math.cos(direction) * (DOUBTFUL_SPEED if vector.state == "doubtful" else 1.0)
        if progress is None or progress.last:
            known = vector.metres is not None
            slowed = APPROACH_GAIN * left if known else self.max_speed * vector.ratio / SLOW_RATIO
            speed = min(speed, max(MIN_SPEED, slowed))
        if scan is not None:
            ranges = np.minimum(scan.ranges, scan.farthest)
            free = free_ahead(ranges, scan.azimuths(), self.robot_radius_m, 0.0)
            stops = free < min(STOP_DISTANCE_M, left)
            speed = 0.0 if stops else min(speed, stopping_speed(min(free, state.free), self.deceleration))
            state.free = free - REACTION_S * speed  # an echo may be missing in the next scan
        return self.Out(command=Command(speed, self._turn(direction)), status=moving)

    def _approaches(self, vector: HomingVector, lost_s: float, sought_s: float) -> bool:
        """Tells that the robot drives towards its target; towards a doubtful one it does so by turns with wandering."""
        if vector.state == "doubtful":
            return sought_s % (WANDER_AFTER_S + DOUBTFUL_S) < DOUBTFUL_S
        return vector.is_found or (lost_s < BLOCKED_AFTER_S and vector.metres is not None)

    def _free_direction(self, vector: HomingVector, scan: Scan | None, left: float) -> tuple[float | None, float]:
        """Direction to drive (rad), None where nothing is free, and the largest speed."""
        if scan is None:
            return float(wrap(vector.direction)), self.max_speed
        ranges, room = np.minimum(scan.ranges, scan.farthest), min(LOOKAHEAD_M, left)
        for margin, speed in ((1.0, 1.0), (NARROW_MARGIN, NARROW_SPEED)):
            direction = free_direction(
                ranges, scan.azimuths(), vector.direction, room, self.robot_radius_m, margin * self.margin_m
            )
            if direction is not None:
                return float(wrap(direction)), speed * self.max_speed
        return None, 0.0

    def _turn(self, angle: float) -> float:
        return max(-self.max_angular_speed, min(self.max_angular_speed, HEADING_GAIN * angle))

    def _stand(self, state: Literal["waiting", "driving", "docking", "arrived", "lost", "blocked"], why: str) -> Out:
        return self.Out(command=Command(0.0, 0.0), status=DrivingStatus(state, why))


def _metres_left(vector: HomingVector, scan: Scan | None) -> float:
    if vector.metres is not None:
        return vector.metres
    if scan is None:
        return math.inf
    # A typical feature is taken to be as far away as what is around the robot.
    return vector.depth_ratio * float(np.median(np.minimum(scan.ranges, scan.farthest)))


def _since(stamp: int | None, now: bool, tick: Tick) -> tuple[int | None, float]:
    # Since when something holds (ns), and for how many seconds.
    if not now:
        return None, 0.0
    stamp = tick.stamp if stamp is None else stamp
    return stamp, (tick.stamp - stamp) / 1e9
