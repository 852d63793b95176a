"""A simulated robot that is told by the truth where its target lies, behind a door: open, and closed."""

import math
from dataclasses import replace

import numpy as np
from world_files import DEMO

from omninav.pipeline import Context
from omninav.stages.control.follow_homing import FollowHoming, FollowHomingState
from omninav.stages.control.stall_monitor import StallMonitor, StallMonitorState
from omninav.stages.simulator.config import Day, Door, Room, mirror
from omninav.stages.source.closed_loop import ClosedLoop, ClosedLoopState
from omninav.stages.values.homing import HomingVector, PathProgress
from omninav.stages.values.pose import Pose

SMALL = mirror(columns=32)
KITCHEN = Room(name="kitchen", corner=(0.0, 0.0), size=(6.0, 3.0), doors=(Door(side="north", at=3.0),))
WORLD = replace(
    DEMO, size=(6.0, 6.0), camera=SMALL, rooms=(KITCHEN,), shelves=(), blocks=(), aisle_blocks=(), wall_panels=(),
    routes={}, days=(Day(), Day(doors=0.0)),
)  # fmt: skip
TARGET = (3.0, 1.5)


def vector(here: Pose) -> HomingVector:
    x, y = TARGET[0] - here.x, TARGET[1] - here.y
    metres = math.hypot(x, y)
    direction = math.remainder(math.atan2(y, x) - here.heading, math.tau)
    return HomingVector(0, direction, 0.0, metres, metres / 4.0, metres / 3.0, metres, 20, "tracking")


def drive(day: int, ticks: int) -> list[tuple[ClosedLoop.Out, FollowHoming.Out]]:
    source, driving = ClosedLoop(world=WORLD, day=day, start=(1.5, 5.0, 0.0), seconds=60.0), FollowHoming()
    monitor, monitored = StallMonitor(), StallMonitorState()
    simulation, state, ctx = ClosedLoopState(), FollowHomingState(), Context("source", np.random.default_rng(0))
    source.setup(ctx)
    progress = PathProgress(0, 0, 1, 0, last=True, docking=False, arrived=False)
    command, done = None, []
    for _ in range(ticks):
        seen = source.step(ctx, simulation, command)
        assert seen is not None
        stalled = monitor.step(ctx, monitored, seen.tick, seen.scan, vector(seen.truth), progress).status
        told = driving.step(Context("control"), state, seen.tick, vector(seen.truth), progress, seen.scan, stalled)
        command = told.command
        done.append((seen, told))
    return done


def test_through_an_open_door_it_comes_to_its_target():
    seen, _ = drive(day=0, ticks=120)[-1]
    assert math.dist((seen.truth.x, seen.truth.y), TARGET) < 0.1
    assert seen.tally.collisions == 0


def test_before_a_closed_door_it_stands_and_says_that_it_is_blocked_and_tries_again_where_nobody_sends_it_elsewhere():
    done = drive(day=1, ticks=200)
    states = [told.status.state for _, told in done]
    first = states.index("blocked")
    assert 50 < first < 150  # the way there, and ten seconds from side to side
    assert set(states[first : first + 50]) == {"blocked"}
    assert states[first + 50] == "driving"
    seen, told = done[-1]
    assert (told.command.speed, told.command.turning) == (0.0, 0.0)
    assert "something is in the way" in told.status.why
    assert seen.truth.y > 3.0
    assert seen.tally.collisions == 0
