"""From homing vectors to commands."""

import math
from typing import Any

import numpy as np
import pytest

from omninav.pipeline import Context, Tick
from omninav.stages.control.follow_homing import FollowHoming, FollowHomingState
from omninav.stages.control.stall_monitor import StallMonitor, StallMonitorState
from omninav.stages.control.wall_avoider import WallAvoider, WallAvoiderState, wandering
from omninav.stages.values.homing import HomingVector, PathProgress
from omninav.stages.values.scan import Scan

STAND = (0.0, 0.0)


def vector(direction: float = 0.0, ratio: float = 0.8, **how) -> HomingVector:
    known = {"number": 0, "turn": 0.0, "depth_ratio": 0.3, "metres": None, "inliers": 20, "state": "tracking"}
    return HomingVector(direction=direction, distance=ratio, ratio=ratio, **{**known, **how})


def lost(**how) -> HomingVector:
    return vector(**{"state": "lost", "why": "2 of 9 matches agree", **how})


def progress(**how) -> PathProgress:
    return PathProgress(**{**dict(path=0, at=0, of=2, target=0, last=False, docking=False, arrived=False), **how})


def scan(*blocks: tuple[float, float, float]) -> Scan:
    """Nothing around but what stands at `metres` between two azimuths (degrees)."""
    azimuths = np.radians(np.arange(-180.0, 180.0, 2.0))
    ranges = np.full(180, np.inf)
    for low, high, metres in blocks:
        ranges[(np.degrees(azimuths) >= low) & (np.degrees(azimuths) <= high)] = metres
    return Scan(ranges, -math.pi, math.radians(2.0), 0.05, 8.0)


class Robot:
    """The stages of driving, wired as in the variants, at five ticks a second."""

    def __init__(self, wanders=False, **how) -> None:
        self.monitor, self.follow, self.wanders = StallMonitor(), FollowHoming(**how), wanders
        self.monitored, self.followed, self.wandered = StallMonitorState(), FollowHomingState(), WallAvoiderState()
        self.ticks, self.clock = 0, 10**15

    def begin_log(self) -> None:
        """Begin a new log, as where the clock was set back: by almost all of the time since 1970."""
        self.ticks, self.clock = 0, 5 * 10**9

    def drive(self, vector, at=None, ring=None) -> FollowHoming.Out:
        stamp, ctx = self.clock + self.ticks * 200_000_000, Context("control")
        tick = Tick(self.ticks, stamp, first_of_log=self.ticks == 0)
        self.ticks += 1
        stalled = self.monitor.step(ctx, self.monitored, tick, ring, vector, at).status
        wander = WallAvoider().step(ctx, ring, self.wandered).command if self.wanders and ring is not None else None
        return self.follow.step(ctx, self.followed, tick, vector, at, ring, stalled, wander)


def drive(said, at=None, ring=None) -> FollowHoming.Out:
    return Robot().drive(said, at, ring)


def command(out: FollowHoming.Out | WallAvoider.Out) -> tuple[float, float]:
    return out.command.speed, out.command.turning


def test_it_drives_where_the_vector_points_within_its_limits() -> None:
    ahead = drive(vector(), progress(), scan())
    assert command(ahead) == (0.4, 0.0)
    left = drive(vector(0.3), progress(), scan())
    assert left.command.speed == pytest.approx(0.4 * math.cos(0.3))
    assert left.command.turning == pytest.approx(1.5 * 0.3)
    for ring in (None, scan()):
        behind = drive(vector(math.tau - 2.8), progress(), ring)
        assert command(behind) == (0.0, -0.8)
        assert behind.status.state == "driving"
    speeds = [drive(vector(math.radians(degrees)), progress()).command.speed for degrees in (34.0, 36.0)]
    assert speeds == pytest.approx([0.4 * math.cos(math.radians(34.0)), 0.0])


def test_a_robot_whose_range_finder_falls_silent_stands_until_it_speaks() -> None:
    robot = Robot()
    for ring, speed in ((None, 0.4), (scan(), 0.4), (None, 0.0), (scan(), 0.4)):
        assert robot.drive(vector(), progress(), ring).command.speed == speed


def test_towards_the_last_view_it_slows_down_but_on_the_way_it_does_not() -> None:
    assert drive(vector(metres=0.2), progress(last=True)).command.speed == pytest.approx(0.7 * 0.2)
    assert drive(vector(ratio=0.15), progress(last=True)).command.speed == pytest.approx(0.2)
    assert drive(vector(metres=0.01), progress(last=True)).command.speed == 0.05
    assert drive(vector(metres=0.2), progress()).command.speed == 0.4
    assert drive(vector(metres=0.2)).command.speed == pytest.approx(0.7 * 0.2)


def test_it_docks_by_turning_alone_and_then_stands() -> None:
    docking = drive(vector(2.0, turn=-0.2), progress(last=True, docking=True), scan())
    assert command(docking) == (0.0, pytest.approx(-0.3))
    assert docking.status.state == "docking"
    arrived = drive(None, progress(arrived=True), scan())
    assert command(arrived) == STAND
    assert arrived.status.state == "arrived"


def test_around_what_stands_in_the_way() -> None:
    # A post 1 m ahead, a little to the left: the way on its right is closer to where it wants to go.
    around = drive(vector(), progress(), scan((-4.0, 12.0, 0.6)))
    assert around.command.turning < 0.0
    assert around.status.state == "driving"


def test_a_blocked_way_stops_it_at_once_and_is_said_when_it_stays_so() -> None:
    robot, closed = Robot(), scan((-180.0, 180.0, 0.4))
    states = []
    for _ in range(12):
        out = robot.drive(vector(), progress(), closed)
        assert command(out) == STAND
        states.append(out.status.state)
    assert states == ["driving"] * 10 + ["blocked"] * 2
    assert drive(vector(), progress(), closed).status.why == "waiting for a way through"
    assert out.status.why == "nothing is free for 0.8 m towards the target"
    assert robot.drive(vector(), progress(), scan()).command.speed == 0.4


def test_who_had_no_target_for_long_waits_anew() -> None:
    closed = scan((-180.0, 180.0, 0.4))
    for idle, state in ((8, "blocked"), (20, "driving")):
        robot = Robot()
        for said in (*3 * [vector()], *idle * [None], vector()):
            out = robot.drive(said, None, closed)
        assert out.status.state == state


@pytest.mark.parametrize(
    ("said", "ring", "state"),
    [
        (vector(), scan((-180.0, 180.0, 0.4)), "blocked"),
        (lost(metres=1.0), scan(), "lost"),
        (vector(state="doubtful"), scan(), "lost"),
    ],
)
def test_whose_clock_is_set_back_waits_no_longer_than_another(said: HomingVector, ring: Scan, state: str) -> None:
    robot, states = Robot(), []
    for ticks in (1, 27):
        states = [robot.drive(said, progress(), ring).status.state for _ in range(ticks)]
        robot.begin_log()
    assert (states[0], states[-1]) == ("driving", state)


def test_before_a_closed_door_it_goes_from_side_to_side_only_for_so_long_and_tries_again_after_a_while(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # The target lies 1 m ahead, behind a wall that is free to the left and to the right: a way to everywhere but there.
    monkeypatch.setattr("omninav.stages.control.stall_monitor.DETOUR_S", 4.0)
    robot, wall = Robot(), scan((-50.0, 50.0, 0.5))
    said = [robot.drive(vector(metres=1.0), progress(), wall) for _ in range(80)]
    states = [out.status.state for out in said]
    assert states == ["driving"] * 21 + ["blocked"] * 20 + ["driving"] * 21 + ["blocked"] * 18
    assert all(out.command.turning for out in said[:21])
    assert command(said[-1]) == STAND
    assert said[-1].status.why == "something is in the way, and going around it for 4 s led no closer"
    another = robot.drive(vector(number=1, metres=1.0, state="new"), progress(), wall)
    assert another.status.state == "driving"


def test_who_comes_closer_on_the_way_around_is_not_blocked(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("omninav.stages.control.stall_monitor.DETOUR_S", 2.0)
    robot, wall = Robot(), scan((-50.0, 50.0, 0.5))
    ratios = 0.95 ** np.arange(40)
    said = [robot.drive(vector(0.0, ratio, metres=ratio), progress(), wall) for ratio in ratios]
    assert {out.status.state for out in said} == {"driving"}


def test_neither_may_it_turn_and_turn_in_the_open_for_ever(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("omninav.stages.control.stall_monitor.STALLED_AFTER_S", 6.0)
    robot = Robot()
    said = [robot.drive(vector(3.0), progress(), scan()) for _ in range(33)]
    assert [out.status.state for out in said] == ["driving"] * 31 + ["blocked"] * 2
    assert said[-1].status.why == "6 s have led no closer"


def test_who_is_lost_for_long_wanders_until_the_target_is_seen() -> None:
    robot = Robot(wanders=True)
    said = [robot.drive(lost(), progress(), scan((-20.0, 0.0, 0.6))) for _ in range(301)]
    assert [command(out) for out in said[:25]] == [STAND] * 25
    assert said[25].command.turning > 0.0  # away from what stands ahead, a little to the right
    assert (said[299].status.state, said[299].status.why) == ("lost", "it wanders: 2 of 9 matches agree")
    assert said[300].status.why == "the target was not seen in 60 s: 2 of 9 matches agree"
    assert robot.drive(vector(), progress(), scan()).status.state == "driving"


def test_who_wanders_keeps_to_the_robots_largest_speed() -> None:
    robot = Robot(wanders=True, max_speed=0.05)
    said = [robot.drive(lost(), progress(), scan()) for _ in range(30)]
    assert said[29].status.why.startswith("it wanders")
    assert said[29].command.speed == 0.05


def test_towards_a_doubtful_target_it_goes_slowly_for_a_while_and_again_as_it_wanders() -> None:
    robot = Robot(wanders=True)
    doubtful = vector(state="doubtful", why="8 of 20 matches agree")
    said = [robot.drive(doubtful, progress(), scan()) for _ in range(60)]
    assert [out.status.state for out in said] == ["driving"] * 25 + ["lost"] * 35  # a planner waits from then on
    assert [out.command.speed for out in said] == [0.2] * 25 + [0.4] * 25 + [0.2] * 10
    assert said[30].status.why == "it wanders: 8 of 20 matches agree"
    assert said[50].status.why == "it drives towards what may be its target: 8 of 20 matches agree"
    another = vector(number=1, state="doubtful")
    assert robot.drive(another, progress(), scan()).status.state == "driving"


def test_a_target_that_is_lost_now_and_then_is_not_given_up() -> None:
    robot = Robot(wanders=True, search_s=4.0)
    said = [robot.drive(vector() if tick % 5 else lost(), progress(), scan()) for tick in range(200)]
    assert not any("not seen" in out.status.why for out in said)


def test_a_search_ends_and_a_target_that_is_seen_then_is_driven_to_all_the_same(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("omninav.stages.control.follow_homing.WANDER_AFTER_S", 1.0)
    robot = Robot(wanders=True, search_s=4.0)
    said = [robot.drive(lost(), progress(), scan()) for _ in range(30)]
    assert [out.command.speed > 0.0 for out in said] == [False] * 5 + [True] * 15 + [False] * 10
    assert said[-1].status.why == "the target was not seen in 4 s: 2 of 9 matches agree"
    assert robot.drive(vector(state="doubtful"), progress(), scan()).command.speed == 0.0
    assert robot.drive(vector(), progress(), scan()).command.speed == 0.4
    another = lost(number=1)
    assert "not seen" not in robot.drive(another, progress(), scan()).status.why


def test_a_lost_robot_stands_where_no_wander_command_is_wired(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("omninav.stages.control.follow_homing.WANDER_AFTER_S", 1.0)
    robot = Robot()
    said = [robot.drive(lost(), progress(), scan()) for _ in range(60)]
    assert all(command(out) == STAND for out in said)


def test_it_drives_no_faster_than_it_can_stop_within_what_is_free_ahead() -> None:
    wall = scan((-60.0, 60.0, 2.25))  # 2 m are free
    for deceleration, fastest in ((0.5, 1.290), (0.1, 0.606), (5.0, 1.5)):
        robot = Robot(max_speed=1.5, deceleration=deceleration)
        speeds = [robot.drive(vector(), progress(), ring).command.speed for ring in (wall, scan(), scan())]
        assert speeds[0] == pytest.approx(fastest, abs=1e-3)
        assert fastest - 0.3 < speeds[1] <= speeds[0]  # an echo that is missing once frees nothing
        assert speeds[2] >= speeds[0]
    slow = scan((-60.0, 60.0, 1.65))  # 1.4 m, of which it keeps 0.25
    assert wander(slow)[0][0] == 0.4
    avoider = WallAvoider(max_speed=1.5).step(Context("wander"), slow, WallAvoiderState())
    assert command(avoider)[0] == pytest.approx(0.932, abs=1e-3)


def test_a_target_close_before_a_wall_can_be_reached() -> None:
    assert drive(vector(metres=0.2), progress(last=True), scan((-60.0, 60.0, 0.7))).command.speed > 0.0


def test_where_metres_are_unknown_a_near_target_is_taken_to_be_as_near_as_what_stands_around() -> None:
    walls = scan((-180.0, 180.0, 2.0), (-40.0, 40.0, 0.6))  # the median range is 2 m
    for depth_ratio, moves in ((0.1, True), (0.35, False)):  # 0.2 m and 0.7 m away
        speed, _ = command(drive(vector(depth_ratio=depth_ratio), progress(last=True), walls))
        assert (speed > 0.0) is moves


def test_it_docks_at_a_wall_closer_than_it_stops_on_the_way() -> None:
    wall = scan((-25.0, 25.0, 0.38))  # 0.1 m free ahead of a robot of 0.25 m, which stops at 0.15 m
    assert drive(vector(metres=0.08), progress(last=True), wall).command.speed > 0.0


@pytest.mark.parametrize(("metres", "speed"), [(0.42, 0.0), (0.47, 0.29052)])
def test_it_stops_before_what_stands_straight_ahead_while_it_turns_to_a_free_direction(
    metres: float, speed: float
) -> None:
    # A post on the right lets it go 0.114 or 0.157 m straight on, and as far as it likes to the left.
    out = drive(vector(math.radians(30.0), metres=2.0), progress(), scan((-31.0, -29.0, metres)))
    assert out.status.state == "driving"
    assert command(out) == pytest.approx((speed, 1.5 * math.radians(30.0)), abs=1e-5)


def test_time_in_which_the_target_is_lost_does_not_count_as_stalled(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("omninav.stages.control.stall_monitor.STALLED_AFTER_S", 2.0)
    robot = Robot()
    for _ in range(30):
        robot.drive(lost(), progress(), scan())
    said = [robot.drive(vector(), progress(), scan()).status.state for _ in range(13)]
    assert said == ["driving"] * 10 + ["blocked"] * 3


def test_neither_does_time_in_which_it_stands_without_a_scan_nor_that_between_two_logs() -> None:
    robot = Robot()
    for ring in (scan(), *200 * [None], *140 * [scan()]):  # silent for 40 s, and 28 s on the way
        assert robot.drive(vector(), progress(), ring).status.state == "driving"
    robot.begin_log()
    said = [robot.drive(vector(), progress(), scan()).status.state for _ in range(12)]
    assert said == ["driving"] * 11 + ["blocked"]


@pytest.mark.parametrize(("side", "speed"), [(0.26, 0.0), (0.28, 0.2), (0.34, 0.2), (0.36, 0.4)])
def test_through_a_door_that_is_hardly_wide_enough_it_goes_slowly(side: float, speed: float) -> None:
    azimuths = scan().azimuths()
    beside = np.abs(np.sin(azimuths)) > 0.05
    ranges = np.where(beside, side / np.maximum(np.abs(np.sin(azimuths)), 1e-9), np.inf)  # walls left and right
    narrow = Scan(ranges, -math.pi, math.radians(2.0), 0.05, 8.0)
    assert drive(vector(), progress(), narrow).command.speed == pytest.approx(speed)


def test_a_lost_target_is_followed_a_little_where_metres_are_known_and_then_it_stands() -> None:
    robot = Robot()
    speeds = [robot.drive(lost(metres=1.0), progress(), scan()) for _ in range(12)]
    assert [out.command.speed > 0.0 for out in speeds] == [True] * 10 + [False] * 2
    assert (speeds[-1].status.state, speeds[-1].status.why) == ("lost", "2 of 9 matches agree")
    unknown = drive(lost(), progress(), scan())
    assert (unknown.command.speed, unknown.status.state) == (0.0, "lost")


def test_without_a_target_it_waits() -> None:
    out = drive(None, None, scan())
    assert (out.command.speed, out.status.state) == (0.0, "waiting")


def blocked_after(ring: Scan, at: PathProgress | None = None, later: float = 0.8, **how) -> float:
    """Seconds after which a robot is said to be blocked of whose way 0.8 are left, and `later` from 15 s on."""
    monitor, state = StallMonitor(), StallMonitorState()
    for tick in range(500):
        now = Tick(tick, 10**15 + tick * 200_000_000)
        said = vector(ratio=0.8 if tick < 75 else later, **how)
        if monitor.step(Context("stall"), state, now, ring, said, at).status is not None:
            return tick / 5
    return math.inf


def post_beside(metres: float) -> Scan:
    """A post so far to the left of the line ahead, 60 degrees from it."""
    return scan((59.0, 61.0, metres / math.sin(math.radians(60.0))))


@pytest.mark.parametrize(
    ("ring", "how", "seconds"),
    [
        (scan(), {}, 30.2),
        (scan(), {"later": 0.73}, 30.2),  # less than a tenth closer is not closer
        (scan(), {"later": 0.71}, 45.2),
        (scan(), {"at": progress(docking=True)}, math.inf),
        (scan(), {"at": progress(arrived=True)}, math.inf),
        (scan((-20.0, 20.0, 0.5)), {}, 10.2),
        (scan((-20.0, 20.0, 0.5)), {"metres": 0.2}, 30.2),  # the target is closer
        (scan((-20.0, 20.0, 1.15)), {}, 30.2),
        (scan((30.0, 80.0, 0.5)), {"direction": math.radians(55.0)}, 10.2),
        (post_beside(0.265), {}, 10.2),  # within the radius and a fifth of the margin
        (post_beside(0.275), {}, 30.2),
    ],
)
def test_who_comes_no_closer_is_blocked_after_ten_seconds_around_something_or_thirty_in_all(
    ring: Scan, how: dict[str, Any], seconds: float
) -> None:
    assert blocked_after(ring, **how) == seconds


def test_who_wanders_turns_away_the_more_the_less_room_there_is_and_keeps_its_side() -> None:
    assert wandering(1.5, 0.3, -1) == pytest.approx((1.0, 0.5 * math.tanh(0.3), 0))
    assert wandering(0.6, 0.0, 0) == pytest.approx((0.6, 0.7, 1))
    assert wandering(0.6, 0.3, -1) == pytest.approx((0.6, -0.7, -1))
    assert wandering(-0.5, -0.3, 0) == pytest.approx((0.0, -1.0, -1))


def wander(*rings: Scan) -> list[tuple[float, float]]:
    state = WallAvoiderState()
    return [command(WallAvoider().step(Context("wander"), ring, state)) for ring in rings]


def test_a_wandering_robot_is_as_fast_as_what_is_free_ahead_allows() -> None:
    # 0.725 m are free before a post: half of the way from 0.25 m, where it stops, to 1.2 m. A wall is on its left.
    post = scan((-1.0, 1.0, 0.975), (60.0, 90.0, 2.0))
    slow, straight = pytest.approx((0.2, -0.6)), pytest.approx((0.4, 0.0))
    assert wander(post, scan(), scan()) == [slow, slow, straight]  # what was seen once counts twice
    assert [wander(post_beside(side))[0][0] for side in (0.39, 0.41)] == [0.0, 0.4]  # 0.4 m to both sides are kept free
