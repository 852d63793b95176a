"""A differential drive steered along waypoints as a hand on a joystick would steer it."""

import math
from bisect import bisect_left
from itertools import accumulate, pairwise

import numpy as np
import numpy.typing as npt

from .config import Point, Robot

F64 = npt.NDArray[np.float64]

STEP = 0.01
"""Seconds of one step of the simulation."""
ARRIVED = 0.05
"""Metres from the last waypoint at which a drive ends."""


class _Route:
    """A line of straight legs, by the distance along it."""

    def __init__(self, waypoints: npt.ArrayLike) -> None:
        points: list[tuple[float, float]] = np.asarray(waypoints, dtype=np.float64).tolist()
        self._points = [points[0], *(b for a, b in pairwise(points) if a != b)]
        self._ends = list(accumulate((math.dist(a, b) for a, b in pairwise(self._points)), initial=0.0))
        self.length = self._ends[-1]

    def at(self, along: float) -> tuple[float, float]:
        """The point `along` metres from the start."""
        if self.length == 0.0:
            return self._points[0][0], self._points[0][1]
        leg = min(max(bisect_left(self._ends, along), 1), len(self._points) - 1)
        (ax, ay), (bx, by) = self._points[leg - 1], self._points[leg]
        part = (along - self._ends[leg - 1]) / (self._ends[leg] - self._ends[leg - 1])
        return ax + part * (bx - ax), ay + part * (by - ay)

    def advance(self, along: float, x: float, y: float) -> float:
        """Where on the next stretch of the line a robot is that was `along` metres on it: never back."""
        candidates = [min(along + 0.02 * step, self.length) for step in range(16)]
        return min(candidates, key=lambda at: math.dist(self.at(at), (x, y)))


def drive(waypoints: npt.ArrayLike, robot: Robot, rate: float, start_heading: float | None = None) -> tuple[F64, F64]:
    """Drive along waypoints (W, 2): times (N,) in seconds from 0 at `rate` (Hz), and poses (N, 3) x, y, heading.

    Pure pursuit: the robot steers for the point of the route `look_ahead` metres on, slower the more it must turn, and
    turns on the spot where it would have to look back. Speed and turning change no faster than the limits allow. The
    robot starts at rest at the first waypoint, facing the second unless `start_heading` is given.
    """
    route = _Route(waypoints)
    x, y = route.at(0.0)
    ahead = route.at(min(0.01, route.length))
    heading = math.atan2(ahead[1] - y, ahead[0] - x) if start_heading is None else start_heading
    goal = route.at(route.length)
    speed = turning = along = time = 0.0
    every = round(1.0 / (rate * STEP))
    poses = [(x, y, heading)]
    step = 0
    patience = 4.0 * route.length / robot.speed + 60.0
    while time < patience:
        along = route.advance(along, x, y)
        remaining = math.hypot(goal[0] - x, goal[1] - y)
        if along >= route.length - robot.look_ahead and remaining < ARRIVED and speed < 0.05:
            break
        aim = route.at(min(along + robot.look_ahead, route.length))
        off = math.remainder(math.atan2(aim[1] - y, aim[0] - x) - heading, 2 * math.pi)
        brake = math.sqrt(2 * 0.5 * robot.acceleration * max(route.length - along - 0.6 * ARRIVED, 0.0))
        wanted_speed = min(robot.speed * max(math.cos(off), 0.0) ** 2 if abs(off) < 1.0 else 0.0, brake)
        wanted_turning = max(-robot.turn_speed, min(robot.turn_speed, 2.0 * off))
        if remaining < 2 * ARRIVED:
            wanted_turning = 0.0
        speed += _limited(wanted_speed - speed, robot.acceleration * STEP)
        turning += _limited(wanted_turning - turning, robot.turn_acceleration * STEP)
        middle = heading + 0.5 * turning * STEP
        x, y = x + speed * math.cos(middle) * STEP, y + speed * math.sin(middle) * STEP
        heading = math.remainder(heading + turning * STEP, 2 * math.pi)
        step += 1
        time = step * STEP
        if step % every == 0:
            poses.append((x, y, heading))
    return np.arange(len(poses)) / rate, np.array(poses)


def wandered(waypoints: tuple[Point, ...], spread: float, rng: np.random.Generator) -> F64:
    """Waypoints (W, 2), each missed by a Gaussian of `spread` metres, cut off at two."""
    miss = np.clip(rng.normal(0.0, spread, (len(waypoints), 2)), -2 * spread, 2 * spread)
    wandering: F64 = np.asarray(waypoints, dtype=np.float64) + miss
    return wandering


def _limited(change: float, limit: float) -> float:
    return max(-limit, min(limit, change))
