"""Where the homing vector points, as fast as is safe."""

import math
from typing import Annotated

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Context, Outputs, Stage, State
from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.values.command import Command
from omninav.stages.values.homing import DrivingStatus, HomingVector, PathProgress
from omninav.stages.values.scan import Scan

from .clearance import free_ahead, roomier_side, way_through
from .wall_avoider import wandering

F64 = npt.NDArray[np.float64]


class FollowHomingState(State):
    """For how many ticks in a row the target has been lost, and for how many there has been no way through.

    `target`: the one it goes to; `closest`: the least ratio of the way to it that was left; ticks since then in all
    (`since`), those in which something stood in the straight way (`around`), and those for which it has stood because
    of that (`stood`). `side`: see `wandering`.
    """

    lost: int = 0
    blocked: int = 0
    target: int = -1
    closest: float = math.inf
    since: int = 0
    around: int = 0
    stood: int = 0
    side: int = 0


class FollowHoming(Stage):
    """Turns towards the homing vector and drives, around what the ring of ranges says is in the way, and docks.

    Goedemé et al. 2007, section 7.2.4, on a lower level of its own. `speed` (m/s) and `turning` (rad/s) are limits; it
    turns by `gain` (1/s) times the angle that is left, on the spot beyond `on_the_spot_deg`. Close to the last view it
    slows down: to `closing` (1/s) times the metres left where odometry has told the unit, else by the share of the way
    that is left, not below `creep` m/s. While it docks it only turns.

    Towards a direction it drives if a disc of `radius` m has `room` m free there, `margin` m clear on both sides, or
    what is left of the way; else towards the free direction closest to it. Where there is none it tries with a fifth
    of the margin, at half the speed. Less than `stop_at` m free straight ahead, or than what is left of the way, stop
    it. Where no direction is free for `patience` ticks it stands and is `blocked`; so it is where it has gone around
    something for `detour` ticks, or about for `idle` ticks, and came no closer to the target (by a tenth of what was
    left): what stands in the way may be a closed door. If nobody gives it another target it tries again after `detour`
    ticks. A lost target: it goes on to where it was believed for
    `patience` ticks, and only where metres are known; then it stands and is `lost`. Both say why on `status`, for
    whoever re-localises and plans anew. Nothing may be known where it stands: lost for `restless` ticks in a row, it
    wanders until it sees where to go; null: it stands.
    """

    speed: Annotated[float, Bounds(gt=0)] = 0.4
    turning: Annotated[float, Bounds(gt=0)] = 0.8
    gain: Annotated[float, Bounds(gt=0)] = 1.5
    closing: Annotated[float, Bounds(gt=0)] = 0.7
    creep: Annotated[float, Bounds(gt=0)] = 0.05
    on_the_spot_deg: Annotated[float, Bounds(gt=0)] = 35.0
    radius: Annotated[float, Bounds(gt=0)] = 0.25
    margin: Annotated[float, Bounds(ge=0)] = 0.1
    room: Annotated[float, Bounds(gt=0)] = 0.8
    stop_at: Annotated[float, Bounds(gt=0)] = 0.15
    patience: Annotated[int, Bounds(ge=1)] = 10
    detour: Annotated[int, Bounds(ge=1)] = 50
    idle: Annotated[int, Bounds(ge=1)] = 150
    restless: Annotated[int, Bounds(ge=1)] | None = None

    class Out(Outputs):
        command: Command
        status: DrivingStatus

    def step(
        self,
        ctx: Context,
        patience: FollowHomingState,
        vector: HomingVector | None = None,
        progress: PathProgress | None = None,
        scan: Scan | None = None,
    ) -> Out:
        """The command of this tick. Without a `scan` it trusts that nothing is in the way."""
        if progress is not None and progress.arrived:
            return self._stand("arrived", "")
        if vector is None:
            return self._stand("waiting", "there is no target")
        patience.lost = patience.lost + 1 if vector.state == "lost" else 0
        if vector.state == "lost" and (patience.lost > self.patience or vector.metres is None):
            if scan is not None and self.restless is not None and patience.lost > self.restless:
                ctx.count("wandered_lost")
                return self._wander(patience, scan, vector.why)
            ctx.count("stood_lost")
            return self._stand("lost", vector.why)
        if progress is not None and progress.docking:
            return self.Out(command=Command(0.0, self._turn(vector.turn)), status=DrivingStatus("docking"))
        left = math.inf if vector.metres is None else vector.metres
        direction: float | None = vector.direction
        squeezed = 1.0
        if scan is not None:
            ranges = np.minimum(scan.ranges, scan.farthest)
            around = scan.azimuths()
            if why := self._kept_away(patience, vector, ranges, around):
                ctx.count("stood_blocked")
                return self._stand("blocked", why)
            direction = way_through(ranges, around, vector.direction, min(self.room, left), self.radius, self.margin)
            if direction is None:  # a target, or a door, closer to a wall than one would keep
                squeezed = 0.5
                room = min(self.room, left)
                direction = way_through(ranges, around, vector.direction, room, self.radius, 0.2 * self.margin)
        patience.blocked = patience.blocked + 1 if direction is None else 0
        if direction is None:
            if patience.blocked <= self.patience:  # somebody may be passing by
                return self._stand("driving", "waiting for a way through")
            ctx.count("stood_blocked")
            return self._stand("blocked", f"nothing is free for {self.room:g} m towards the target")
        direction = float(wrap(direction))
        if abs(direction) > math.radians(self.on_the_spot_deg):
            return self.Out(command=Command(0.0, self._turn(direction)), status=DrivingStatus("driving"))
        speed = squeezed * self.speed * math.cos(direction)
        if progress is None or progress.last:
            slowed = self.closing * left if vector.metres is not None else self.speed * vector.ratio / 0.3
            speed = min(speed, max(self.creep, slowed))
        if scan is not None and free_ahead(ranges, scan.azimuths(), self.radius, 0.0) < min(self.stop_at, left):
            speed = 0.0
        return self.Out(command=Command(speed, self._turn(direction)), status=DrivingStatus("driving"))

    def _kept_away(self, patience: FollowHomingState, vector: HomingVector, ranges: F64, around: F64) -> str:
        """Why it will not come closer to the target than it has been, "" as long as it may."""
        if vector.number != patience.target:
            patience.target, patience.closest = vector.number, math.inf
        if patience.stood >= self.detour:
            patience.closest = math.inf
        if vector.ratio < 0.9 * patience.closest:
            patience.closest, patience.since, patience.around, patience.stood = vector.ratio, 0, 0, 0
        elif vector.state != "lost":
            left = self.room if vector.metres is None else min(self.room, vector.metres)
            in_the_way = free_ahead(ranges, around - vector.direction, self.radius, 0.2 * self.margin) < left
            patience.since, patience.around = patience.since + 1, patience.around + in_the_way
        patience.stood += patience.around > self.detour or patience.since > self.idle
        if patience.around > self.detour:
            return f"something stands in the way, and going around it for {self.detour} ticks led no closer"
        return f"{self.idle} ticks have led no closer" if patience.since > self.idle else ""

    def _wander(self, patience: FollowHomingState, scan: Scan, why: str) -> Out:
        ranges, around = np.minimum(scan.ranges, scan.farthest), scan.azimuths()
        room = (free_ahead(ranges, around, self.radius, self.margin) - self.stop_at) / self.room
        speed, turning, patience.side = wandering(room, roomier_side(ranges, around), patience.side)
        command = Command(0.5 * self.speed * speed, self.turning * turning)
        return self.Out(command=command, status=DrivingStatus("lost", f"it looks about: {why}"))

    def _turn(self, angle: float) -> float:
        return max(-self.turning, min(self.turning, self.gain * angle))

    def _stand(self, state: str, why: str) -> Out:
        return self.Out(command=Command(0.0, 0.0), status=DrivingStatus(state, why))  # type: ignore[arg-type]
