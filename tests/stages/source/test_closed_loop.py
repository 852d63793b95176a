"""A simulated robot that is told where to go."""

import dataclasses
import math
from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from world_files import DEMO

from omninav.pipeline import BadInput, Context
from omninav.pipeline.engine.codec import decode, encode, encode_state, restore_state
from omninav.stages.control.wall_avoider import WallAvoider, WallAvoiderState
from omninav.stages.geometry.plane.se2 import compose
from omninav.stages.recordings.recording import UnreadableRecording
from omninav.stages.simulator.bodies import box_array
from omninav.stages.simulator.cameras import camera_of, camera_rays, shutter_times
from omninav.stages.simulator.config import Delivery, Kidnapping, OdometryNoise, Ranges, Sensor, WorldConfig, mirror
from omninav.stages.simulator.obstacles import gather
from omninav.stages.simulator.renderer import render
from omninav.stages.simulator.robot import around, limits, reach, steer
from omninav.stages.simulator.world import World
from omninav.stages.source.closed_loop import ClosedLoop, ClosedLoopState
from omninav.stages.values.command import Command
from omninav.stages.values.drive import pose_row
from omninav.stages.values.homing import PathProgress
from omninav.stages.values.planned_route import PlannedRoute
from omninav.stages.values.scan import Scan

SMALL = mirror(columns=80)
WORLD = replace(DEMO, camera=SMALL)
EXACT = replace(WORLD, odometry=OdometryNoise(0.0, 0.0, 0.0, 0.0, 0.0, 0.0))


class Loop:
    """A source with the memory that an engine would keep for it."""

    def __init__(self, seed: int = 0, **parameters: object) -> None:
        self.source = ClosedLoop(**{"world": WORLD, **parameters})  # type: ignore[arg-type]
        self.ctx = Context("source", np.random.default_rng(seed))
        self.state = ClosedLoopState()
        self.source.setup(self.ctx)

    def step(
        self, command: Command | None = None, way: PlannedRoute | None = None, progress: PathProgress | None = None
    ) -> ClosedLoop.Out | None:
        return self.source.step(self.ctx, self.state, command, way, progress)

    def drive(self, command: Command | None = None, ticks: int = 10**6) -> list[ClosedLoop.Out]:
        """So many ticks with one command, or all until it ends."""
        outs: list[ClosedLoop.Out] = []
        while len(outs) < ticks and (out := self.step(command)) is not None:
            outs.append(out)
        return outs


def route(state: Literal["under way", "arrived", "gave up"]) -> PlannedRoute:
    return PlannedRoute(np.array([3]), state, 0)


def flat(out: ClosedLoop.Out) -> bytes:
    return encode({field.name: getattr(out, field.name) for field in dataclasses.fields(out)})


def test_it_starts_where_the_route_starts_and_ends_when_the_time_is_over():
    loop = Loop(seconds=1.0)
    ticks = loop.drive()
    assert len(ticks) == loop.source.length() == 5
    assert (ticks[0].truth.x, ticks[0].truth.y) == WORLD.routes["drive"].waypoints[0]
    assert ticks[0].motion is None
    assert [out.tick.first_of_log for out in ticks] == [True, False, False, False, False]
    assert np.diff([out.tick.stamp for out in ticks]).tolist() == [200_000_000] * 4
    assert vars(ticks[-1].truth) == vars(ticks[0].truth)  # nobody told it to move


@pytest.mark.parametrize(
    ("going", "ended"),
    [
        pytest.param([route("under way")], [route("arrived")], id="arrived"),
        pytest.param([route("under way")], [route("gave up")], id="gave up"),
        pytest.param(
            [None, PathProgress(0, 1, 2, 1, True, False, False)],
            [None, PathProgress(0, 2, 2, 1, True, True, True)],
            id="a path that has been gone",
        ),
    ],
)
def test_a_way_that_has_ended_ends_the_drive_a_moment_later(going, ended):
    loop = Loop(seconds=20.0, rest_s=1.0)
    outs = [loop.step(Command(0.0, 0.0), *way) for way in [[], *[going] * 5, *[ended] * 9]]
    assert [out is not None for out in outs] == [True] * 11 + [False] * 4
    assert loop.ctx.warnings == []


@pytest.mark.parametrize("command", [None, Command(0.0, 0.0)])
@pytest.mark.parametrize("going", [[], [route("under way")], [None, PathProgress(0, 1, 2, 1, True, False, False)]])
def test_a_drive_whose_time_is_over_on_its_way_warns_and_one_without_commands(going, command):
    loop = Loop(seconds=1.0)
    assert [loop.step(command, *going) is not None for _ in range(6)] == [True] * 5 + [False]
    told = ["The time is over after 1 s"] * bool(going) + ["No command came in 1 s"] * (command is None)
    assert [warning.partition(", and ")[0] for warning in loop.ctx.warnings] == told


def test_it_is_sent_on_from_goal_to_goal_and_ends_after_the_last():
    loop = Loop(seconds=20.0, rest_s=0.4, goals=((1.0, 2.0), (3.0, 4.0)))
    going, ended = route("under way"), route("gave up")
    outs = [loop.step(None, way) for way in (None, ended, going, ended, going, *[ended] * 3)]
    goals = [None if out is None or out.goal is None else (out.goal.x, out.goal.y) for out in outs]
    assert goals == [None, (1.0, 2.0), None, (3.0, 4.0), None, None, None, None]
    assert [out is not None for out in outs] == [True] * 7 + [False]


def test_a_goal_without_room_is_refused_and_one_that_nobody_drives_to():
    with pytest.raises(UnreadableRecording, match=r"goals: 3\.7, 2\.4 .* radius"):
        Loop(goals=((1.5, 1.3), (3.7, 2.4)))
    source, ctx = ClosedLoop(world=WORLD, goals=((1.5, 1.3),)), Context("source")
    ctx.read = frozenset({"image", "scan"})
    with pytest.raises(BadInput, match=r"nodes\.source\.goals"):
        source.setup(ctx)


def test_it_obeys_and_its_wheels_say_how_far_it_came():
    loop = Loop(world=EXACT, start=(1.5, 1.3, 0.0))
    loop.step()
    outs = loop.drive(Command(0.4, 0.0), 25)
    driven = 0.4 * 5.0 - 0.4**2 / (2 * WORLD.robot.acceleration)
    assert outs[-1].truth.x == pytest.approx(1.5 + driven, abs=0.01)
    assert outs[-1].tally.distance == pytest.approx(driven, abs=0.01)
    assert outs[-1].odometry.x == pytest.approx(driven, abs=0.01)
    assert sum(out.motion.x for out in outs) == pytest.approx(driven, abs=0.01)


def test_without_a_command_it_brakes():
    loop = Loop()
    loop.drive(Command(0.4, 0.0), 6)
    last = loop.drive(None, 10)[-1].motion
    assert math.hypot(last.x, last.y) < 1e-6


def test_a_robot_driven_into_a_shelf_is_counted_and_stays_outside():
    out = Loop(start=(3.7, 1.5, math.pi / 2)).drive(Command(0.4, 0.0), 40)[-1]
    assert out.tally.collisions >= 1
    world = World(WORLD, 1)
    assert world.clearance([[out.truth.x, out.truth.y]])[0] == pytest.approx(WORLD.robot.radius, abs=0.01)


def test_its_ranges_are_those_of_the_world_around_it():
    exact = replace(WORLD, ranges=Ranges(noise=0.0, dropout=0.0, beam_width=1e-6))
    scan = Loop(world=exact, start=(1.2, 4.5, math.pi)).drive(ticks=1)[0].scan
    assert scan.ranges[8] == pytest.approx(1.2, abs=0.05)  # the wall ahead, or the poster on it
    assert scan.azimuths()[8] == pytest.approx(0.0)


def test_somebody_who_lifts_it_is_not_seen_by_its_wheels():
    loop = Loop(world=EXACT, start=(1.5, 1.3, 0.0), kidnappings=(Kidnapping(at=1.0, to=(9.5, 7.3, 0.0)),))
    after = loop.drive(Command(0.2, 0.0), 6)[5]
    assert after.truth.x == 9.5
    assert abs(after.motion.x) < 0.05


def test_kidnappings_that_do_not_happen_are_told_of():
    loop = Loop(seconds=1.0, kidnappings=(Kidnapping(at=0.8, turn=1.0), Kidnapping(at=0.9, turn=1.0)))
    loop.drive(Command(0.2, 0.0))
    assert loop.ctx.warnings == ["The drive ended after 1 s: the robot was not carried at 0.9 s."]
    carried = replace(EXACT.routes["drive"], kidnappings=(Kidnapping(at=0.4, turn=1.0),))
    loop = Loop(world=replace(EXACT, routes={**EXACT.routes, "drive": carried}))
    assert loop.ctx.warnings[0].startswith("The kidnappings of the route 'drive' are for logs of it")
    with pytest.raises(BadInput, match="only a robot with a drawn start is carried"):
        Loop(carried_m=1.0)


def test_it_is_put_down_anywhere_every_so_many_metres_and_elsewhere_for_each_seed():
    put = []
    for seed in (0, 0, 1):
        loop = Loop(seed, world=EXACT, start=(1.5, 1.3, 0.0), kidnapped_every_m=0.5)
        spots = np.array([(out.truth.x, out.truth.y) for out in loop.drive(Command(0.4, 0.0), 20)])
        jumps = np.flatnonzero(np.hypot(*np.diff(spots, axis=0).T) > 0.3)
        assert 1 <= len(jumps) <= 3
        assert World(EXACT, 1).is_free(spots[jumps + 1], EXACT.robot.radius).all()
        put.append(spots[jumps[0] + 1])
    assert np.array_equal(put[0], put[1])
    assert not np.array_equal(put[0], put[2])


def test_its_images_are_blurred_by_its_motion_around_their_tick():
    """What it sees is the mean over where it is about to be and has just been; at rest it is one picture."""
    quiet = replace(EXACT, sensor=Sensor(noise=0.0, exposure_drift=0.0, shutter=0.1))
    still = replace(quiet, sensor=replace(quiet.sensor, shutter=0.0))
    sharp, blurred = (Loop(world=world, start=(1.5, 1.3, 0.0)) for world in (still, quiet))
    first = [loop.drive(ticks=1)[0].image for loop in (sharp, blurred)]
    assert first[0] is not None
    np.testing.assert_array_equal(first[0].pixels, first[1].pixels)
    last = [loop.drive(Command(0.3, 0.5), 8)[-1].image.pixels for loop in (sharp, blurred)]
    assert np.abs(last[0].astype(int) - last[1]).mean() > 0.5
    state, world = blurred.state.robot, World(quiet, blurred.source.day)
    room = gather(box_array(world.obstacles), quiet.size, reach(quiet.robot))
    poses = around(state, [-0.05, 0.0, 0.05])
    driven = np.repeat(state[None], 2, axis=0)
    steer(driven[0], 0.3, 0.5, limits(quiet.robot), 0.05, room)
    np.testing.assert_allclose(poses[2], driven[0, :3], atol=1e-3)
    np.testing.assert_array_equal(poses[1], state[:3])
    steps = around(state, shutter_times(quiet.sensor, 0.0))
    rays = camera_rays(camera_of(quiet), quiet.sensor.vignetting, quiet.robot.radius)
    seen = render(world.scene, rays, steps, quiet.eye_height)
    np.testing.assert_array_equal(last[1], seen)


def test_lost_images_are_absent_and_counted():
    loop = Loop(world=replace(WORLD, delivery=Delivery(dropped=0.4, late=0.3)))
    lost = sum(out.image is None for out in loop.drive(ticks=40))
    assert loop.ctx.counts["lost_image"] + loop.ctx.counts["late_image"] == lost
    assert 0.35 < lost / 40 < 0.8


def test_motion_is_that_between_two_images_and_tick_motion_that_of_every_tick():
    loop = Loop(world=replace(EXACT, delivery=Delivery(dropped=0.4)), start=(1.5, 1.3, 0.0))
    outs = loop.drive(Command(0.3, 0.2), 30)
    seen, ticks = np.zeros(3), np.zeros(3)
    for out in outs[1:]:
        ticks = compose(ticks, (out.tick_motion.x, out.tick_motion.y, out.tick_motion.turn))
        assert (out.motion is None) == (out.image is None)
        if out.image is not None:
            seen = compose(seen, (out.motion.x, out.motion.y, out.motion.turn))
            assert seen == pytest.approx(ticks)
            assert seen == pytest.approx(pose_row(out.odometry))
    assert 5 < sum(out.image is None for out in outs) < 20


def test_a_loop_that_is_put_to_sleep_goes_on_to_the_same_bytes():
    commands = [Command(0.4, math.sin(k)) for k in range(20)]
    whole = Loop(seed=3)
    unbroken = [flat(out) for out in (whole.step(command) for command in commands) if out]
    first = Loop(seed=3)
    for command in commands[:9]:
        first.step(command)
    saved = decode(encode({"state": encode_state(first.state), "generator": first.ctx.generator_state()}))
    second = Loop(seed=99)
    restore_state(second.state, saved["state"])
    second.ctx.restore(saved["generator"], second.ctx.notes())
    assert [flat(out) for out in (second.step(command) for command in commands[9:]) if out] == unbroken[9:]


def test_another_seed_is_another_noise_in_the_same_world():
    one, same, other = (Loop(seed=seed).drive(ticks=1)[0] for seed in (0, 0, 1))
    assert flat(one) == flat(same) != flat(other)
    assert vars(one.truth) == vars(other.truth)


def test_a_route_that_is_not_there_is_refused():
    with pytest.raises(UnreadableRecording, match="no route 'nowhere' to start from; it has: drive, tour"):
        Loop(route="nowhere")


# the driver


def ring(**near: float) -> Scan:
    """16 readings at 4 m but for some, by number: `ring(_8=0.3)` has something ahead."""
    ranges = np.full(16, np.inf)
    for name, metres in near.items():
        ranges[int(name[1:])] = metres
    return Scan(ranges, -math.pi, math.pi / 8, nearest=0.0, farthest=4.0)


def test_the_driver_goes_on_where_there_is_room_and_turns_on_the_spot_where_there_is_none():
    driver = WallAvoider()
    ctx = Context("driver")
    free = driver.step(ctx, ring(), WallAvoiderState()).command
    assert (free.speed, free.turning) == pytest.approx((driver.max_speed, 0.0))
    blocked = driver.step(ctx, ring(_8=0.4, _9=0.5), WallAvoiderState()).command
    assert blocked.speed == 0.0
    assert blocked.turning < 0.0


def test_a_single_missing_echo_does_not_free_the_way():
    driver, memory, ctx = WallAvoider(), WallAvoiderState(), Context("driver")
    driver.step(ctx, ring(_8=0.4), memory)
    assert driver.step(ctx, ring(), memory).command.speed == 0.0
    assert driver.step(ctx, ring(), memory).command.speed == driver.max_speed


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_driver_wanders_without_touching_anything(seed: int, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(ClosedLoop, "_look", lambda *_: None)  # it does not look at pictures
    loop, driver, memory = Loop(seed=seed, seconds=300.0), WallAvoider(), WallAvoiderState()
    command, track = None, []
    while (out := loop.step(command)) is not None:
        command = driver.step(loop.ctx, out.scan, memory).command
        track.append((out.truth.x, out.truth.y))
        last = out
    assert last.tally.collisions == 0
    assert last.tally.distance > 60.0
    assert np.ptp(np.array(track)[:, 0]) > 6.0


def test_a_world_without_any_route_can_be_started_anywhere():
    assert Loop(world=WorldConfig(camera=SMALL), start=(2.0, 2.0, 0.0)).step() is not None


def test_a_place_without_room_is_refused():
    said = r"start: 3.7, 2.9 of world 'home_store_demo' is 0\.00 m from an obstacle, and the robot's radius is 0\.25 m"
    with pytest.raises(UnreadableRecording, match=said):
        Loop(start=(3.7, 2.9, 0.0))
    with pytest.raises(UnreadableRecording, match=r"kidnappings: 0\.1, 0\.1 of world"):
        Loop(kidnappings=(Kidnapping(at=1.0, to=(0.1, 0.1, 0.0)),))


def test_a_drawn_start_has_a_free_straight_way_back_and_another_for_each_seed():
    ends = []
    for seed in (0, 0, 1):
        loop = Loop(seed, start="drawn", carried_m=1.5)
        loop.drive(Command(0.0, 0.0), 5)
        first, put = np.array(loop.source._first), np.array(loop.source._kidnappings[0].to)
        assert math.dist(first[:2], put[:2]) == pytest.approx(1.5)
        way = first[:2] + np.linspace(0.0, 1.0, 30)[:, None] * (put[:2] - first[:2])
        assert World(WORLD, 1).is_free(way, WORLD.robot.radius).all()
        assert loop.state.robot[:3] == pytest.approx(put)
        ends.append(put)
    assert np.array_equal(ends[0], ends[1])
    assert not np.array_equal(ends[0], ends[2])
