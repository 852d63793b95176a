"""People who walk about a world or accompany the robot, and their appearance."""

import math
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from omninav.stages.geometry.arrays import Array, Bools, Shorts
from omninav.stages.geometry.plane.se2 import wrap

from .bodies import Coverings, Tiling
from .streams import stream

OUTFITS = 16
"""Number of different outfits."""
RADIUS_M = 0.25
WALKER_CLEARANCE_M = 0.32
"""Clearance (m) of a walker's path from obstacles."""
STRIDE_M = 0.7
"""Metres a step."""
MIN_ROBOT_DISTANCE_M = 0.6
"""Metres that people keep from the robot's middle."""
MAX_COMPANIONS = 4
"""Maximum number of people who accompany the robot."""
MAX_SPEED = 1.3
"""Maximum speed of a person, m/s."""
MIN_PERSON_DISTANCE_M = 2.1 * RADIUS_M
"""Minimum distance (m) between two people near the robot."""
GIVE_WAY_DISTANCE_M = 0.58
"""Distance (m) from the robot below which a person who cannot step aside disappears."""
OUT_OF_SIGHT_M, GIVE_UP_DISTANCE_M = 5.0, 3.0
"""Metres from the robot beyond which a person may appear or disappear; metres from the desired place."""
MIN_ABSENCE_S = 5.0
"""Minimum time (s) for which a person is gone."""
STEP_S = 0.2
"""Time step (s) of people near the robot."""


@dataclass(frozen=True)
class Person:
    """Somebody at a moment: where (m), facing where (rad), width and height (m), in which clothes, mid which step."""

    position: tuple[float, float]
    heading: float
    radius: float = RADIUS_M
    height: float = 1.75
    look: int = 0
    stride: float = 0.0
    """Phase (rad) of the step; legs are together at multiples of pi."""


class BodyPart(NamedTuple):
    """A part of a body as shares of its height: forward and left offset, half sizes, lower and upper edge, swing."""

    ahead: float
    left: float
    half_ahead: float
    half_left: float
    low: float
    high: float
    swing: float
    """Metres that it moves forward with half of a step, against the other side."""


PARTS = (
    BodyPart(0.0, 0.055, 0.045, 0.045, 0.0, 0.49, 0.13),
    BodyPart(0.0, -0.055, 0.045, 0.045, 0.0, 0.49, -0.13),
    BodyPart(0.0, 0.0, 0.065, 0.115, 0.45, 0.84, 0.0),
    BodyPart(0.0, 0.14, 0.03, 0.026, 0.42, 0.82, -0.1),
    BodyPart(0.0, -0.14, 0.03, 0.026, 0.42, 0.82, 0.1),
    BodyPart(0.005, 0.0, 0.055, 0.045, 0.86, 1.0, 0.0),
)
"""Legs, trunk, arms, head."""


def coverings(texture: Callable[[str, str], int], look: int) -> tuple[Coverings, ...]:
    """Coverings of the parts of people of a look; `texture` gives the number of a texture by material and name."""
    name = f"person {look}"
    trousers, coat, face, hair = (texture(m, name) for m in ("trousers", "coat", "face", "hair"))

    def covered(part: BodyPart, sides: int, front: int, top: int) -> Coverings:
        tall = 1.75 * (part.high - part.low)
        deep, wide = 3.5 * part.half_ahead, 3.5 * part.half_left
        over = np.full((1, 1), top)
        end, before = Tiling(np.full((1, 1), sides), wide, tall), Tiling(np.full((1, 1), front), wide, tall)
        flank = Tiling(np.full((1, 1), sides), deep, tall)
        return (end, before, flank, flank, Tiling(over, deep, wide), Tiling(over, deep, wide))

    legs, trunk, arms, head = (trousers,) * 3, (coat,) * 3, (coat,) * 3, (hair, face, hair)
    looks = (legs, legs, trunk, arms, arms, head)
    return tuple(covered(part, *look) for part, look in zip(PARTS, looks, strict=True))


def figures(people: Sequence[Person], looks: Shorts) -> tuple[Array, Shorts]:
    """Boxes (P, 9) of people's parts, as `bodies.box_array` has them, and their surfaces (P, 6) from `Scene.looks`."""
    if not people or not len(looks):
        return np.zeros((0, 9)), np.zeros((0, 6), dtype=np.int32)
    parts = np.array(PARTS)
    at = np.array([person.position for person in people])[:, None]
    heading = np.array([person.heading for person in people])[:, None]
    height = np.array([person.height for person in people])[:, None]
    swing = np.sin([person.stride for person in people])[:, None] * parts[:, 6]
    cos, sin = np.cos(heading), np.sin(heading)
    ahead, left = height * parts[:, 0] + swing, height * parts[:, 1]
    half_ahead, half_left = height * parts[:, 2], height * parts[:, 3]
    boxes = np.stack(
        [
            at[..., 0] + cos * ahead - sin * left,
            at[..., 1] + sin * ahead + cos * left,
            np.broadcast_to(cos, ahead.shape),
            np.broadcast_to(sin, ahead.shape),
            half_ahead,
            half_left,
            height * parts[:, 4],
            height * parts[:, 5],
            half_ahead**2 + half_left**2,
        ],
        axis=-1,
    )
    return boxes.reshape(-1, 9), looks[[person.look % len(looks) for person in people]].reshape(-1, 6)


Clearance = Callable[[Array], Array]
"""Distance (m) of points (N, 2) to the nearest obstacle."""


class Walker:
    """A person who walks between random places in straight free lines, with halts."""

    def __init__(self, rng: np.random.Generator, start: tuple[float, float], clearance: Clearance) -> None:
        self._rng = rng
        self._clearance = clearance
        self.height = float(rng.uniform(1.5, 1.95))
        self.look = int(rng.integers(OUTFITS))
        self._speed = float(rng.uniform(0.5, 1.2))
        self._heading = float(rng.uniform(-math.pi, math.pi))
        self._legs: list[tuple[float, float, float, float, float]] = [(0.0, *start, self._heading, 0.0)]

    def at(self, seconds: float) -> Person:
        """This person at a time from 0 on; the same whatever was asked before."""
        while self._legs[-1][0] <= seconds:
            self._next_leg()
        number = bisect_right(self._legs, seconds, key=lambda moment: moment[0]) - 1
        (t0, x0, y0, _, way0), (t1, x1, y1, heading, way1) = self._legs[number : number + 2]
        part = (seconds - t0) / (t1 - t0)
        position = (x0 + part * (x1 - x0), y0 + part * (y1 - y0))
        stride = math.pi * (way0 + part * (way1 - way0)) / STRIDE_M
        return Person(position, heading, RADIUS_M, self.height, self.look, stride)

    def _next_leg(self) -> None:
        """Add a leg, or a halt facing aside."""
        time, x, y, _, way = self._legs[-1]
        rng = self._rng
        if rng.uniform() < 0.25:
            aside = self._heading + math.copysign(math.pi / 2, rng.uniform(-1.0, 1.0))
            self._legs.append((time + float(rng.uniform(2.0, 15.0)), x, y, aside, way))
            return
        bearings = self._heading + np.concatenate([rng.normal(0.0, 0.6, 12), rng.uniform(-math.pi, math.pi, 12)])
        lengths = rng.uniform(0.8, 7.0, len(bearings))
        along = lengths[:, None] * np.linspace(1.0 / 28, 1.0, 28)
        points = np.stack([x + along * np.cos(bearings)[:, None], y + along * np.sin(bearings)[:, None]], axis=-1)
        free = (self._clearance(points.reshape(-1, 2)) > WALKER_CLEARANCE_M).reshape(along.shape).all(axis=1)
        worth = np.where(free, lengths * (1.3 + np.cos(bearings - self._heading)), -1.0)
        best = int(np.argmax(worth))
        if worth[best] <= 0.0:
            self._heading += float(rng.uniform(1.0, 2.5))
            self._legs.append((time + 1.0, x, y, self._heading, way))
            return
        self._heading = float(bearings[best])
        goal, length = points[best, -1], float(lengths[best])
        took = length / self._speed
        self._legs.append((time + took, float(goal[0]), float(goal[1]), self._heading, way + length))


class RobotTrack(NamedTuple):
    """Track of the robot: times (N,) in seconds, ascending, and poses (N, 3)."""

    times: Array
    poses: Array


class Companion:
    """A person who accompanies the robot at 0.6 to 1.5 m, and falls back from time to time."""

    def __init__(self, rng: np.random.Generator, clearance: Clearance) -> None:
        self._clearance = clearance
        self.height = float(rng.uniform(1.5, 1.95))
        self.look = int(rng.integers(OUTFITS))
        self._bearing = float(rng.uniform(0.9, 2.6) * rng.choice([-1.0, 1.0]))
        self._period = float(rng.uniform(50.0, 110.0))
        self._phase = float(rng.uniform(0.0, 1.0))
        self._sway = rng.uniform(0.0, 2.0 * math.pi, 2)

    def desired_place(self, seconds: float, track: RobotTrack, others: Array) -> Array | None:
        """Place (2,) that this person would like, given the robot's up to then; None: no room but `others'`."""
        poses = track.poses[-2000:]
        x, y = poses[-1, :2]
        gait = np.cumsum(np.hypot(*np.diff(poses[::-1, :2], axis=0).T))
        span = max(1, int(np.searchsorted(track.times, seconds - 3.0)))
        recent = track.poses[span - 1 :, 2]
        facing = math.atan2(float(np.sin(recent).mean()), float(np.cos(recent).mean()))
        # Away for a third of the time, near for the rest, and a few seconds between
        beat = math.cos(2.0 * math.pi * (seconds / self._period + self._phase))
        back = 1.0 / (1.0 + math.exp(-12.0 * (beat - 0.5)))
        near = 1.05 + 0.35 * math.sin(0.21 * seconds + self._sway[0])
        behind = near + 7.0 * back
        followed = _back_along(poses, gait, behind)
        places = [_back_along(poses, gait, behind + 0.7 * k) for k in range(5)]
        if back <= 0.5:
            bearing = self._bearing + 0.4 * math.sin(0.13 * seconds + self._sway[1])
            options = facing + np.array([bearing, -bearing, 1.2 * bearing, math.pi])
            beside = np.array([x, y]) + near * np.stack([np.cos(options), np.sin(options)], axis=-1)
            part = (2.0 * back) ** 2
            places = [*((1.0 - part) * beside + part * followed), *places]
        return next((place for place in places if self._has_room(place, x, y, others)), None)

    def _has_room(self, place: Array, x: float, y: float, others: Array) -> bool:
        """Tells whether a place is free and, if near the robot at (x, y), has a free line to it."""
        if math.hypot(place[0] - x, place[1] - y) < MIN_ROBOT_DISTANCE_M:
            return False
        if len(others) and np.hypot(*(others - place).T).min() < 2.2 * RADIUS_M:
            return False
        between = np.array([place, [0.5 * (place[0] + x), 0.5 * (place[1] + y)]])
        clear = self._clearance(between) > (0.8 * RADIUS_M, 0.0)
        return bool(clear[0] and (clear[1] or math.dist(place, (x, y)) > 2.0))


def _back_along(poses: Array, gait: Array, distance: float) -> Array:
    """The point of the robot's path `distance` m back along it, or its start."""
    found = int(np.searchsorted(gait, distance))
    point: Array = poses[max(0, len(poses) - 2 - found), :2]
    return point


X, Y, HEADING, WALKED, GONE = range(5)
"""State of the crowd (P, 5), of each person: place, facing, metres walked, since when (s) it is gone or -1."""


class Crowd:
    """The people of a world on a day: walkers, and a few companions of the robot where its track is known.

    Nobody walks faster than `MAX_SPEED` or through anything. A person in the robot's way steps aside, or disappears for
    a while and comes back out of the robot's sight. The same seed, day, time and track give the same people, whatever
    the order of the times that are asked for.
    """

    def __init__(self, seed: int, day: int, count: int, size: tuple[float, float], clearance: Clearance) -> None:
        rng = stream(seed, "people", day)
        near = min(MAX_COMPANIONS, (count + 4) // 8)
        self._companions = [Companion(stream(seed, "companion", day, k), clearance) for k in range(near)]
        self._walkers: list[Walker] = []
        self._clearance = clearance
        for number in range(count - near):
            points = rng.uniform((0.0, 0.0), size, (200, 2))
            free = points[clearance(points) > WALKER_CLEARANCE_M]
            if len(free):
                start = (float(free[0, 0]), float(free[0, 1]))
                self._walkers.append(Walker(stream(seed, "walker", day, number), start, clearance))
        self._everybody: list[Walker | Companion] = [*self._walkers, *self._companions]
        self._known: tuple[RobotTrack, list[Array]] | None = None

    def at(self, seconds: float, track: RobotTrack | None = None) -> tuple[Person, ...]:
        """All people at a time in seconds; companions only if the robot's track is known."""
        if track is None or not len(track.times):
            return tuple(walker.at(max(0.0, seconds)) for walker in self._walkers)
        known = self._known
        if known is None or known[0].times is not track.times or known[0].poses is not track.poses:
            self._known = known = track, [self.initial_state(track)]
        states, begin = known[1], float(track.times[0])
        whole = max(0, math.floor((seconds - begin) / STEP_S + 1e-9))
        while len(states) <= whole + 1:
            now = begin + STEP_S * (len(states) - 1)
            states.append(self.advanced(states[-1], now, now + STEP_S, track))
        part = min(max((seconds - begin) / STEP_S - whole, 0.0), 1.0)
        state = states[whole].copy()
        there = (state[:, GONE] < 0.0) & (states[whole + 1][:, GONE] < 0.0)
        change = states[whole + 1] - states[whole]
        change[:, HEADING] = wrap(change[:, HEADING])
        state[there] += part * change[there]
        later = states[whole + 1][:, [X, Y]]
        strolls = [
            who.at(begin + STEP_S * whole).position == tuple(states[whole][number, :2])
            and who.at(begin + STEP_S * (whole + 1)).position == tuple(later[number])
            for number, who in enumerate(self._walkers)
        ]
        return self.visible(state, seconds, strolls)

    def initial_state(self, track: RobotTrack) -> Array:
        """State of all people at the start of a drive (P, 5), walkers first."""
        now = float(track.times[0])
        state = np.zeros((len(self._everybody), 5))
        state[:, GONE] = now - MIN_ABSENCE_S
        return self._advanced(state, now, 0.0, RobotTrack(track.times[:1], track.poses[:1]), begins=True)

    def advanced(self, state: Array, seconds: float, until: float, track: RobotTrack) -> Array:
        """State (P, 5) at time `until`, from the robot's track up to `seconds` alone."""
        steps = math.ceil((until - seconds) / STEP_S - 1e-9)
        last = max(1, int(np.searchsorted(track.times, seconds + 1e-9, side="right")))
        known = RobotTrack(track.times[:last], track.poses[:last])
        for number in range(steps):
            end = until if number == steps - 1 else seconds + STEP_S
            state = self._advanced(state, end, end - seconds, known)
            seconds = end
        return state

    def visible(self, state: Array, seconds: float, strolls: Sequence[bool] | None = None) -> tuple[Person, ...]:
        """The people who are present; `strolls`: walkers whom nothing keeps from their own path."""
        people = []
        for number, (row, who) in enumerate(zip(state, self._everybody, strict=True)):
            if row[GONE] < 0.0:
                at = float(row[X]), float(row[Y])
                strolling = who.at(max(0.0, seconds)) if isinstance(who, Walker) else None
                free = strolling is not None and (strolling.position == at if strolls is None else strolls[number])
                if strolling is not None and free:
                    people.append(strolling)
                else:
                    stride = math.pi * float(row[WALKED]) / STRIDE_M
                    people.append(Person(at, float(row[HEADING]), RADIUS_M, who.height, who.look, stride))
        return tuple(people)

    def _advanced(self, before: Array, now: float, took: float, track: RobotTrack, begins: bool = False) -> Array:
        """State one step later: each person in turn moves towards the desired place, avoiding others and the robot."""
        state = before.copy()
        robot = _expected(track, now)
        for number, who in enumerate(self._everybody):
            there = state[:, GONE] < 0.0
            there[number] = False
            if isinstance(who, Walker):
                there[: len(self._walkers)] = False  # walkers pass one another
                desired_place: Array | None = np.array(who.at(max(0.0, now)).position)
            else:
                desired_place = who.desired_place(now, track, state[there, :2])
            row = state[number]
            if row[GONE] >= 0.0 or begins:
                if isinstance(who, Companion) and not begins:
                    desired_place = _out_of_sight(track.poses[-2000:, :2], robot)
                self._reappear(row, desired_place, now, robot, state[there, :2], 0.0 if begins else OUT_OF_SIGHT_M)
            else:
                goal = row[:2].copy() if desired_place is None else desired_place
                if (
                    isinstance(who, Companion)
                    and math.dist(goal, row[:2]) > 1.2
                    and not _has_given_up(row, goal, robot)
                ):
                    goal = _ahead_on_track(track.poses[-2000:, :2], row[:2])
                self._walk(row, goal, now, took, robot, state[there, :2])
                if isinstance(who, Companion):
                    row[HEADING] = math.atan2(robot[1] - row[Y], robot[0] - row[X])
        return state

    def _reappear(
        self, row: Array, desired_place: Array | None, now: float, robot: Array, others: Array, away: float
    ) -> None:
        """Let an absent person reappear, far from the robot and from others."""
        if (
            desired_place is None
            or now - row[GONE] < MIN_ABSENCE_S
            or math.dist(desired_place, robot) < max(away, MIN_ROBOT_DISTANCE_M)
        ):
            return
        if not len(others) or np.hypot(*(others - desired_place).T).min() >= MIN_PERSON_DISTANCE_M:
            row[[X, Y]], row[GONE] = desired_place, -1.0
            row[HEADING] = math.atan2(robot[1] - desired_place[1], robot[0] - desired_place[0])

    def _walk(self, row: Array, goal: Array, now: float, took: float, robot: Array, others: Array) -> None:
        """A step towards the desired place, or aside if others or the robot are in the way."""
        place = row[:2].copy()
        if _has_given_up(row, goal, robot):
            row[GONE] = now
            return
        far = MAX_SPEED * took
        length = min(math.dist(goal, place), far)
        if length < far:  # it was chosen for having room
            step, free = goal, not len(others) or np.hypot(*(others - goal).T).min() >= MIN_PERSON_DISTANCE_M
        else:
            step = place + (goal - place) / math.dist(goal, place) * far
            free = self._passable(step[None], place, others)[0]
        if not free or math.dist(step, robot) < MIN_ROBOT_DISTANCE_M:
            bearings = 2.0 * math.pi / 16 * np.arange(16)
            options = place + far * np.stack([np.cos(bearings), np.sin(bearings)], axis=-1)
            options = np.concatenate([place[None], options])
            from_robot = np.hypot(*(options - robot).T)
            lets = self._passable(options, place, others)
            lets[0] = True
            cost = np.hypot(*(options - goal).T) + 100.0 * np.maximum(MIN_ROBOT_DISTANCE_M - from_robot, 0.0)
            best = int(np.argmin(np.where(lets, cost, np.inf)))
            step = options[best]
            if from_robot[best] < GIVE_WAY_DISTANCE_M:
                row[GONE] = now
                return
        gone = math.dist(step, place)
        row[:2] = step
        row[WALKED] += gone
        if gone > 1e-6:
            row[HEADING] = math.atan2(step[1] - place[1], step[0] - place[0])

    def _passable(self, places: Array, start: Array, others: Array) -> Bools:
        """Which of the places (N, 2) can be reached from `start` without touching obstacles or others."""
        room = min(0.8 * RADIUS_M, float(self._clearance(start[None])[0]))
        free: Bools = self._clearance(places) >= room
        if len(others):
            gaps = np.hypot(*(places[:, None] - others).transpose(2, 0, 1))
            free &= (gaps >= np.minimum(MIN_PERSON_DISTANCE_M, np.hypot(*(others - start).T))).all(axis=1)
        return free


def _has_given_up(row: Array, goal: Array, robot: Array) -> bool:
    """Tells whether a person is too far from the desired place, out of the robot's sight."""
    return math.dist(goal, row[:2]) > GIVE_UP_DISTANCE_M and math.dist(row[:2], robot) > OUT_OF_SIGHT_M


def _out_of_sight(path: Array, robot: Array) -> Array | None:
    """The last point of the robot's path (N, 2) that is out of its sight."""
    far = np.flatnonzero(np.hypot(*(path - robot).T) >= OUT_OF_SIGHT_M)
    return path[far[-1]] if len(far) else None


def _expected(track: RobotTrack, now: float) -> Array:
    """Predicted position (2,) of the robot at constant velocity; its last one if the velocity is unknown."""
    at: Array = track.poses[-1, :2]
    if len(track.times) < 2:
        return at
    took = float(track.times[-1] - track.times[-2])
    speed: Array = (at - track.poses[-2, :2]) / took
    return at if float(np.hypot(*speed)) > MAX_SPEED else at + speed * (now - float(track.times[-1]))


def _ahead_on_track(path: Array, place: Array) -> Array:
    """The point of the robot's path (N, 2) some 0.8 m on from where it comes nearest to a place."""
    nearest = int(np.argmin(((path - place) ** 2).sum(axis=1)))
    gone = np.cumsum(np.hypot(*np.diff(path[nearest:], axis=0).T))
    point: Array = path[min(nearest + 1 + int(np.searchsorted(gone, 0.8)), len(path) - 1)]
    return point
