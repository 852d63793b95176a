"""Finds the way through what is around a robot, to its target or, where it is lost, to where it has not been."""

import math
from dataclasses import field, replace
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage, State, Tick
from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.plane.roadmap import ahead_on
from omninav.stages.geometry.plane.se2 import compose, wrap_angle
from omninav.stages.values.command import Command
from omninav.stages.values.homing import HomingVector
from omninav.stages.values.pose import Motion
from omninav.stages.values.scan import Scan

from .clearance import free_ahead, free_direction
from .local_grid import (
    CELL_M,
    CELLS,
    OCCUPIED_COST,
    cell_at,
    frontier,
    marked,
    on_grid,
    prices,
    shifted,
    way_to,
    ways_from,
)

RECENTRE_M = 1.5
"""Distance of the robot from the grid's middle at which the grid moves along, metres."""
AHEAD_M = 0.6
"""Distance along a way of the point that the robot drives towards, metres."""
ROOM_M = 0.3
"""Free distance that a searching robot needs ahead of it, metres."""
TURN_IN_PLACE_DEG, TURN_GAIN = 30.0, 1.5
"""Angle beyond which a searching robot turns on the spot, degrees, and angular speed over the angle, 1/s."""


class LocalPlannerState(State):
    """The grid (see `local_grid`; empty before the first scan) and the robot's pose (3,) in it; whether it was lost."""

    evidence: Array = field(default_factory=lambda: np.zeros((CELLS, CELLS)))
    pose: Array = field(default_factory=lambda: np.zeros(3))
    lost: bool = False


class LocalPlanner(Stage):
    """Leads the homing vector around what ranges show in the way, and a lost robot to where it has not been.

    A grid around the robot keeps what ranges have shown, carried along by odometry. Where the straight way to the
    target is not free, the vector points along the cheapest way there. While the target is lost, `search` drives
    slowly along free space to the nearest place beside which nothing is known (Yamauchi 1997); it is absent where
    there is none. The grid is cleared when the target is lost: the robot may have been carried elsewhere.
    """

    robot_radius_m: Annotated[float, Bounds(gt=0)] = 0.25
    """Radius of the robot's body, metres."""
    search_speed: Annotated[float, Bounds(gt=0)] = 0.15
    """Speed of a robot that is lost, m/s."""
    max_angular_speed: Annotated[float, Bounds(gt=0)] = 0.8
    """rad/s."""

    class Out(Outputs):
        vector: HomingVector | None = None
        search: Command | None = None

    def step(
        self,
        ctx: Context,
        state: LocalPlannerState,
        tick: Tick,
        scan: Scan | None = None,
        motion: Motion | None = None,
        vector: HomingVector | None = None,
        tick_motion: Motion | None = None,
    ) -> Out:
        """Look at one tick. Without a `scan` the vector is passed on. `tick_motion`: of a robot whose `motion` is
        that between two images."""
        if tick.first_of_log:  # the robot has been put elsewhere
            vars(state).update(vars(LocalPlannerState()))
        motion = tick_motion or motion
        if motion is not None:
            state.pose = compose(state.pose, (motion.x, motion.y, motion.turn))
        lost = vector is not None and not vector.is_found
        if lost and not state.lost:
            state.evidence = np.zeros((CELLS, CELLS))
        state.lost = lost
        self._recentre(state)
        if scan is None:
            return self.Out(vector=vector)
        state.evidence = marked(state.evidence, state.pose, scan.ranges, scan.azimuths(), scan.farthest)
        if vector is None:
            return self.Out()
        if lost:
            return self.Out(vector=vector, search=self._search(ctx, state, scan))
        return self.Out(vector=self._around(ctx, state, vector))

    def _around(self, ctx: Context, state: LocalPlannerState, vector: HomingVector) -> HomingVector:
        if vector.metres is None:
            return vector
        here, towards = state.pose[:2], state.pose[2] + vector.direction
        target = here + vector.metres * np.array([math.cos(towards), math.sin(towards)])
        cost = prices(state.evidence, self.robot_radius_m)
        straight = np.linspace(0.0, 1.0, 2 + int(vector.metres / CELL_M))[:, None] * (target - here) + here
        if all(cost.flat[cell_at(point)] < OCCUPIED_COST for point in straight[1:][on_grid(straight[1:])]):
            return vector
        line = way_to(cell_at(target), ways_from(cell_at(here), cost))
        if len(line) == 1:
            return vector
        ctx.count("led_around")
        if on_grid(target[None])[0]:
            line[-1] = target
        ahead, beyond = ahead_on(line, here, AHEAD_M)
        x, y = ahead - here
        return replace(
            vector,
            direction=wrap_angle(math.atan2(y, x) - state.pose[2]),
            metres=max(vector.metres, math.hypot(x, y) + beyond),
        )

    def _search(self, ctx: Context, state: LocalPlannerState, scan: Scan) -> Command | None:
        cost = prices(state.evidence, self.robot_radius_m)
        unseen = frontier(state.evidence, cost)
        if not len(unseen):
            ctx.count("nothing_unseen")
            return None
        ways = ways_from(cell_at(state.pose[:2]), cost)
        line = way_to(int(unseen[np.argmin(ways.price[unseen])]), ways)
        x, y = ahead_on(line, state.pose[:2], AHEAD_M)[0] - state.pose[:2]
        wanted = wrap_angle(math.atan2(y, x) - state.pose[2])
        ranges = np.minimum(scan.ranges, scan.farthest)
        free = free_direction(ranges, scan.azimuths(), wanted, ROOM_M, self.robot_radius_m, CELL_M / 2)
        turn = wrap_angle(wanted if free is None else free)
        turning = max(-self.max_angular_speed, min(self.max_angular_speed, TURN_GAIN * turn))
        ahead = free_ahead(ranges, scan.azimuths(), self.robot_radius_m, 0.0)
        drives = free is not None and abs(turn) <= math.radians(TURN_IN_PLACE_DEG) and ahead >= CELL_M
        return Command(self.search_speed if drives else 0.0, turning)

    def _recentre(self, state: LocalPlannerState) -> None:
        if max(abs(state.pose[0]), abs(state.pose[1])) <= RECENTRE_M:
            return
        columns, rows = np.round(state.pose[:2] / CELL_M).astype(np.int64).tolist()
        state.evidence = shifted(state.evidence, rows, columns)
        state.pose = state.pose - CELL_M * np.array([columns, rows, 0.0])
