"""Notices that a robot comes no closer to its target."""

import math
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage, State, Tick
from omninav.stages.values.homing import DrivingStatus, HomingVector, PathProgress
from omninav.stages.values.scan import Scan

from .clearance import LOOKAHEAD_M, free_ahead

CLOSER = 0.9
"""Share of the smallest distance so far that counts as having come closer."""
NARROW_MARGIN = 0.2
"""Share of the margin with which a direct way still counts as free."""
DETOUR_S = 10.0
"""Time around an obstacle that may lead no closer, seconds."""
STALLED_AFTER_S = 30.0
"""Time in all that may lead no closer, seconds."""


class StallMonitorState(State):
    """The target, the smallest ratio of the way to it that was left, and times (ns) since then.

    `stalled`: in all; `detour`: in which something was in the direct way; `blocked`: in which it was reported as
    blocked. `stamp`: of the tick before.
    """

    target: int = -1
    closest: float = math.inf
    stalled: int = 0
    detour: int = 0
    blocked: int = 0
    stamp: int = 0


class StallMonitor(Stage):
    """Reports a blocked way when the robot has driven for some time without getting closer to its target.

    What is in the direct way may be a closed door, around which there is no way. The robot is no longer blocked as
    soon as it has another target, or after `DETOUR_S`, so that it tries again if nobody plans again. The time in which
    the target is lost or the range finder is silent does not count.
    """

    robot_radius_m: Annotated[float, Bounds(gt=0)] = 0.25
    """Radius of the robot's body."""
    margin_m: Annotated[float, Bounds(ge=0)] = 0.1
    """Room that the robot keeps on both sides."""

    class Out(Outputs):
        """`blocked`, with the reason; absent where nothing speaks against driving on."""

        status: DrivingStatus | None = None

    def step(
        self,
        ctx: Context,
        state: StallMonitorState,
        tick: Tick,
        scan: Scan | None = None,
        vector: HomingVector | None = None,
        progress: PathProgress | None = None,
    ) -> Out:
        elapsed, state.stamp = 0 if tick.first_of_log else tick.stamp - state.stamp, tick.stamp
        if scan is None or vector is None or (progress is not None and (progress.docking or progress.arrived)):
            return self.Out()
        if vector.number != state.target or state.blocked >= DETOUR_S * 1e9:
            state.target, state.closest = vector.number, math.inf
        if vector.ratio < CLOSER * state.closest:
            state.closest, state.stalled, state.detour, state.blocked = vector.ratio, 0, 0, 0
        elif vector.is_found:
            state.stalled += elapsed
            state.detour += elapsed if self._obstructed(vector, scan) else 0
        why = ""
        if state.detour > DETOUR_S * 1e9:
            why = f"something is in the way, and going around it for {DETOUR_S:g} s led no closer"
        elif state.stalled > STALLED_AFTER_S * 1e9:
            why = f"{STALLED_AFTER_S:g} s have led no closer"
        if not why:
            return self.Out()
        state.blocked += elapsed
        return self.Out(status=DrivingStatus("blocked", why))

    def _obstructed(self, vector: HomingVector, scan: Scan) -> bool:
        ranges = np.minimum(scan.ranges, scan.farthest)
        left = LOOKAHEAD_M if vector.metres is None else min(LOOKAHEAD_M, vector.metres)
        margin = NARROW_MARGIN * self.margin_m
        return free_ahead(ranges, scan.azimuths() - vector.direction, self.robot_radius_m, margin) < left
