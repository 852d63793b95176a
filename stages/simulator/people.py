"""People who walk about a world, stand before its goods and keep the robot company; and what they look like."""

import math
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from .bodies import Coverings, Tiling
from .streams import stream

F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]

LOOKS = 16
"""Different people there are, by their clothes."""
RADIUS = 0.25
ROOM = 0.32
"""Clearance (m) of a walker's way from its middle line."""
STEP_LENGTH = 0.7
"""Metres a step."""
NEAREST = 0.6
"""Metres from the robot's middle that people keep."""
COMPANIONS = 4
"""People at most who take an interest in the robot at a time."""


@dataclass(frozen=True)
class Person:
    """Somebody at a moment: where (m), facing where (rad), width and height (m), in which clothes, mid which step."""

    position: tuple[float, float]
    heading: float
    radius: float = RADIUS
    height: float = 1.75
    look: int = 0
    stride: float = 0.0
    """Phase (rad) of the step; legs are together at multiples of pi."""


class Part(NamedTuple):
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
    Part(0.0, 0.055, 0.045, 0.045, 0.0, 0.49, 0.13),
    Part(0.0, -0.055, 0.045, 0.045, 0.0, 0.49, -0.13),
    Part(0.0, 0.0, 0.065, 0.115, 0.45, 0.84, 0.0),
    Part(0.0, 0.14, 0.03, 0.026, 0.42, 0.82, -0.1),
    Part(0.0, -0.14, 0.03, 0.026, 0.42, 0.82, 0.1),
    Part(0.005, 0.0, 0.055, 0.045, 0.86, 1.0, 0.0),
)
"""Legs, trunk, arms, head."""


def coverings(texture: Callable[[str, str], int], look: int) -> tuple[Coverings, ...]:
    """What covers the parts of people of a look; `texture` gives the number of a texture by material and name."""
    name = f"person {look}"
    trousers, coat, face, hair = (texture(m, name) for m in ("trousers", "coat", "face", "hair"))

    def covered(part: Part, sides: int, front: int, top: int) -> Coverings:
        tall = 1.75 * (part.high - part.low)
        deep, wide = 3.5 * part.half_ahead, 3.5 * part.half_left
        over = np.full((1, 1), top)
        end, before = Tiling(np.full((1, 1), sides), wide, tall), Tiling(np.full((1, 1), front), wide, tall)
        flank = Tiling(np.full((1, 1), sides), deep, tall)
        return (end, before, flank, flank, Tiling(over, deep, wide), Tiling(over, deep, wide))

    leg, trunk, arm, head = PARTS[0], PARTS[2], PARTS[3], PARTS[5]
    return (
        covered(leg, trousers, trousers, trousers),
        covered(leg, trousers, trousers, trousers),
        covered(trunk, coat, coat, coat),
        covered(arm, coat, coat, coat),
        covered(arm, coat, coat, coat),
        covered(head, hair, face, hair),
    )


def figures(people: Sequence[Person], looks: I32) -> tuple[F64, I32]:
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


Clearance = Callable[[F64], F64]
"""Distance (m) of points (N, 2) to the nearest obstacle."""


class Walker:
    """Somebody strolling: from one stop to the next in straight free lines, forward rather than back, with halts."""

    def __init__(self, rng: np.random.Generator, start: tuple[float, float], clearance: Clearance) -> None:
        self._rng = rng
        self._clearance = clearance
        self.height = float(rng.uniform(1.5, 1.95))
        self.look = int(rng.integers(LOOKS))
        self._speed = float(rng.uniform(0.5, 1.2))
        self._heading = float(rng.uniform(-math.pi, math.pi))
        self._moments: list[tuple[float, float, float, float, float]] = [(0.0, *start, self._heading, 0.0)]

    def at(self, seconds: float) -> Person:
        """This person at a time from 0 on; the same whatever was asked before."""
        while self._moments[-1][0] <= seconds:
            self._go_on()
        number = bisect_right(self._moments, seconds, key=lambda moment: moment[0]) - 1
        (t0, x0, y0, _, way0), (t1, x1, y1, heading, way1) = self._moments[number : number + 2]
        part = (seconds - t0) / (t1 - t0)
        position = (x0 + part * (x1 - x0), y0 + part * (y1 - y0))
        stride = math.pi * (way0 + part * (way1 - way0)) / STEP_LENGTH
        return Person(position, heading, RADIUS, self.height, self.look, stride)

    def _go_on(self) -> None:
        """Another leg, or a halt: turned aside, as if to look at something."""
        time, x, y, _, way = self._moments[-1]
        rng = self._rng
        if rng.uniform() < 0.25:
            aside = self._heading + math.copysign(math.pi / 2, rng.uniform(-1.0, 1.0))
            self._moments.append((time + float(rng.uniform(2.0, 15.0)), x, y, aside, way))
            return
        bearings = self._heading + np.concatenate([rng.normal(0.0, 0.6, 12), rng.uniform(-math.pi, math.pi, 12)])
        lengths = rng.uniform(0.8, 7.0, len(bearings))
        along = lengths[:, None] * np.linspace(1.0 / 28, 1.0, 28)
        points = np.stack([x + along * np.cos(bearings)[:, None], y + along * np.sin(bearings)[:, None]], axis=-1)
        free = (self._clearance(points.reshape(-1, 2)) > ROOM).reshape(along.shape).all(axis=1)
        worth = np.where(free, lengths * (1.3 + np.cos(bearings - self._heading)), -1.0)
        best = int(np.argmax(worth))
        if worth[best] <= 0.0:
            self._heading += float(rng.uniform(1.0, 2.5))
            self._moments.append((time + 1.0, x, y, self._heading, way))
            return
        self._heading = float(bearings[best])
        goal, length = points[best, -1], float(lengths[best])
        took = length / self._speed
        self._moments.append((time + took, float(goal[0]), float(goal[1]), self._heading, way + length))


class Track(NamedTuple):
    """Where the robot was: times (N,) in seconds, ascending, and poses (N, 3)."""

    times: F64
    poses: F64


class Companion:
    """Somebody who wants advice: comes up beside or behind the robot, stays within 0.6 to 1.5 m, falls back."""

    def __init__(self, rng: np.random.Generator, clearance: Clearance) -> None:
        self._clearance = clearance
        self.height = float(rng.uniform(1.5, 1.95))
        self.look = int(rng.integers(LOOKS))
        self._bearing = float(rng.uniform(0.9, 2.6) * rng.choice([-1.0, 1.0]))
        self._period = float(rng.uniform(50.0, 110.0))
        self._phase = float(rng.uniform(0.0, 1.0))
        self._sway = rng.uniform(0.0, 2.0 * math.pi, 2)

    def at(self, seconds: float, track: Track, others: Sequence[Person]) -> Person | None:
        """This person at a time, from where the robot was up to then; nobody where there is no room beside `others`."""
        last = int(np.searchsorted(track.times, seconds, side="right"))
        if last < 2:
            return None
        poses = track.poses[max(0, last - 2000) : last]
        x, y = poses[-1, :2]
        gait = np.cumsum(np.hypot(*np.diff(poses[::-1, :2], axis=0).T))
        span = max(1, int(np.searchsorted(track.times[:last], seconds - 3.0)))
        recent = track.poses[span - 1 : last, 2]
        facing = math.atan2(float(np.sin(recent).mean()), float(np.cos(recent).mean()))
        # Away for a third of the time, near for the rest, and a few seconds between
        beat = math.cos(2.0 * math.pi * (seconds / self._period + self._phase))
        back = 1.0 / (1.0 + math.exp(-12.0 * (beat - 0.5)))
        near = 1.05 + 0.35 * math.sin(0.21 * seconds + self._sway[0])
        behind = near + 7.0 * back
        followed = self._on_track(poses, gait, behind)
        places = [self._on_track(poses, gait, behind + 0.7 * k) for k in range(5)]
        if back <= 0.5:
            bearing = self._bearing + 0.4 * math.sin(0.13 * seconds + self._sway[1])
            options = facing + np.array([bearing, -bearing, 1.2 * bearing, math.pi])
            beside = np.array([x, y]) + near * np.stack([np.cos(options), np.sin(options)], axis=-1)
            part = (2.0 * back) ** 2
            places = [*((1.0 - part) * beside + part * followed), *places]
        position = next((place for place in places if self._has_room(place, x, y, others)), None)
        if position is None:
            return None
        towards = math.atan2(y - position[1], x - position[0])
        moving = float(np.hypot(*(poses[-1, :2] - poses[max(0, len(poses) - 20), :2]))) > 0.05
        stride = 2.5 * seconds if moving else 0.0
        return Person((float(position[0]), float(position[1])), towards, RADIUS, self.height, self.look, stride)

    def _has_room(self, place: F64, x: float, y: float, others: Sequence[Person]) -> bool:
        """Whether one can stand at a place: on nobody's feet, and if near the robot at (x, y) with nothing between."""
        if math.hypot(place[0] - x, place[1] - y) < NEAREST:
            return False
        if any(math.dist(place, other.position) < 2.2 * RADIUS for other in others):
            return False
        between = np.array([place, [0.5 * (place[0] + x), 0.5 * (place[1] + y)]])
        clear = self._clearance(between) > (0.8 * RADIUS, 0.0)
        return bool(clear[0] and (clear[1] or math.dist(place, (x, y)) > 2.0))

    def _on_track(self, poses: F64, gait: F64, distance: float) -> F64:
        """The point of the robot's way that lies `distance` m back along it, or its start."""
        found = int(np.searchsorted(gait, distance))
        point: F64 = poses[max(0, len(poses) - 2 - found), :2]
        return point


class Crowd:
    """The people of a world on a day: walkers all over, of whom a few keep the robot company where its track is known.

    The same seed, day, time and track give the same people, in whatever order times are asked for.
    """

    def __init__(self, seed: int, day: int, count: int, size: tuple[float, float], clearance: Clearance) -> None:
        rng = stream(seed, "people", day)
        near = min(COMPANIONS, (count + 4) // 8)
        self._companions = [Companion(stream(seed, "companion", day, k), clearance) for k in range(near)]
        self._walkers = []
        self._clearance = clearance
        for number in range(count - near):
            points = rng.uniform((0.0, 0.0), size, (200, 2))
            free = points[clearance(points) > ROOM]
            if len(free):
                start = (float(free[0, 0]), float(free[0, 1]))
                self._walkers.append(Walker(stream(seed, "walker", day, number), start, clearance))

    def at(self, seconds: float, track: Track | None = None) -> tuple[Person, ...]:
        """Everybody at a time in seconds. Walkers make room for the robot."""
        people = [walker.at(max(0.0, seconds)) for walker in self._walkers]
        if track is None or not len(track.times):
            return tuple(people)
        last = max(0, int(np.searchsorted(track.times, seconds, side="right")) - 1)
        x, y = track.poses[last, :2]
        people = [aside for p in people if (aside := self._aside(p, float(x), float(y))) is not None]
        for companion in self._companions:
            person = companion.at(seconds, track, people)
            if person is not None:
                people.append(person)
        return tuple(people)

    def _aside(self, person: Person, x: float, y: float) -> Person | None:
        """A person as far from the robot as it takes, or nobody where that is no place to stand."""
        off = np.array(person.position) - (x, y)
        distance = float(np.hypot(*off))
        if distance >= NEAREST:
            return person
        moved = np.array([(x, y)]) + off / max(distance, 1e-6) * NEAREST
        if self._clearance(moved)[0] < 0.5 * RADIUS:
            return None
        return replace(person, position=(float(moved[0, 0]), float(moved[0, 1])))
