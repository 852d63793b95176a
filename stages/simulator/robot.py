"""A differential drive steered along waypoints as a hand on a joystick would steer it."""

import math

import numpy as np
import numpy.typing as npt

from .config import Point, Robot

F64 = npt.NDArray[np.float64]

STEP = 0.01
"""Seconds of one step of the simulation."""
ARRIVED = 0.05
"""Metres from the last waypoint at which a drive ends."""


def drive(waypoints: npt.ArrayLike, robot: Robot, rate: float, start_heading: float | None = None) -> tuple[F64, F64]:
    """Drive along waypoints (W, 2): times (N,) in seconds from 0 at `rate` (Hz), and poses (N, 3) x, y, heading.

    Pure pursuit: the robot steers for the point of the route `look_ahead` metres on, slower the more it must turn, and
    turns on the spot where it would have to look back. Speed and turning change no faster than the limits allow. The
    robot starts at rest at the first waypoint, facing the second unless `start_heading` is given.
    """
    route = np.asarray(waypoints, dtype=np.float64)
    legs = np.diff(route, axis=0)
    lengths = np.hypot(legs[:, 0], legs[:, 1])
    ends = np.cumsum(lengths)
    x, y = (float(v) for v in route[0])
    heading = math.atan2(legs[0, 1], legs[0, 0]) if start_heading is None else start_heading
    speed = turning = along = time = 0.0
    every = round(1.0 / (rate * STEP))
    poses = [(x, y, heading)]
    step = 0
    patience = 4.0 * float(ends[-1]) / robot.speed + 60.0
    while time < patience:
        along = _advance(route, legs, lengths, ends, along, x, y)
        remaining = math.hypot(route[-1, 0] - x, route[-1, 1] - y)
        if along >= ends[-1] - robot.look_ahead and remaining < ARRIVED and speed < 0.05:
            break
        aim = _at(route, legs, lengths, ends, min(along + robot.look_ahead, float(ends[-1])))
        off = math.remainder(math.atan2(aim[1] - y, aim[0] - x) - heading, 2 * math.pi)
        brake = math.sqrt(2 * 0.5 * robot.acceleration * max(float(ends[-1]) - along - 0.6 * ARRIVED, 0.0))
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


def _advance(route: F64, legs: F64, lengths: F64, ends: F64, along: float, x: float, y: float) -> float:
    """How far along the route the robot is: the nearest point of the next stretch, never back."""
    best, nearest = along, math.inf
    for ahead in np.arange(0.0, 0.31, 0.02):
        at = min(along + float(ahead), float(ends[-1]))
        point = _at(route, legs, lengths, ends, at)
        distance = math.hypot(point[0] - x, point[1] - y)
        if distance < nearest:
            best, nearest = at, distance
    return best


def _at(route: F64, legs: F64, lengths: F64, ends: F64, along: float) -> tuple[float, float]:
    """The point of the route `along` metres from its start."""
    leg = min(int(np.searchsorted(ends, along)), len(legs) - 1)
    part = 1.0 - (ends[leg] - along) / lengths[leg]
    return float(route[leg, 0] + part * legs[leg, 0]), float(route[leg, 1] + part * legs[leg, 1])
