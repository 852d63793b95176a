"""A differential drive, steered by commands or along a route by pure pursuit."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from omninav.pipeline.engine.compiled import compiled
from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.plane.se2 import compose, distances_along

from .config import Kidnapping, Robot
from .obstacles import Obstacles, gather, nearest

STEP_S = 0.01
"""Seconds of one step of the simulation, or about as many: a command lasts a whole number of steps."""
ARRIVAL_M = 0.05
"""Metres from the last waypoint at which a drive ends."""
CONTACT_RELEASE_M = 0.02
"""Metres from an obstacle at which a contact has ended; the next one counts again."""
REJOIN_TOLERANCE_M = 0.5
"""Metres within which two stretches of a route count as equally near to a place."""
NO_PEOPLE: Array = np.zeros((0, 3))
"""No people in the way."""

X, Y, HEADING, SPEED, TURNING, IN_CONTACT, COLLISIONS, DISTANCE = range(8)
"""Indices of a robot's state (8,): pose, m/s, rad/s, 1 in contact, contacts so far, metres driven so far."""


@dataclass(frozen=True, eq=False)
class SimulatedDrive:
    """A drive: `times` (N,) s, `poses` (N, 3), and the poses to which the wheels had rolled, `rolled_to` (N, 3).

    The last two differ only where the robot was lifted. `collisions`: how often it came into contact. `kidnappings`:
    those that took place before the end of the drive, each with its row. `driven_m` and `planned_m`: metres that were
    driven, and that the line has but for what was skipped by being carried. `arrived`: whether it came to its end.
    """

    times: Array
    poses: Array
    rolled_to: Array
    collisions: int
    kidnappings: tuple[tuple[int, Kidnapping], ...]
    driven_m: float
    planned_m: float
    arrived: bool


def at_rest(pose: npt.ArrayLike) -> Array:
    """The state (8,) of a stationary robot at a pose."""
    state = np.zeros(8)
    state[:3] = pose
    return state


def limits(robot: Robot) -> Array:
    """Limits of a robot's motion, (6,): radius, speed, turning, both accelerations, and 1 if it slides."""
    slides = float(robot.contact == "slide")
    return np.array([robot.radius, robot.speed, robot.turn_speed, robot.acceleration, robot.turn_acceleration, slides])


def reach(robot: Robot) -> float:
    """Distance (m) up to which a robot needs to know obstacles."""
    return robot.radius + 2 * CONTACT_RELEASE_M


def steer(
    state: Array, speed: float, turning: float, robot: Array, seconds: float, room: Obstacles, people: Array = NO_PEOPLE
) -> None:
    """Drive on for some time under one command (m/s, rad/s): `state` (8,) changes, within the `limits` (6,) of a robot.

    A robot that would get closer to an obstacle or a person than its radius does not: it slides along, or is held
    and each new contact is counted. It can always turn, and always back away.
    """
    _steer(state, speed, turning, robot, *_divided(seconds), room, people)


def _divided(seconds: float) -> tuple[int, float]:
    """The number of steps into which a time is divided, and their seconds."""
    steps = max(1, round(seconds / STEP_S))
    return steps, seconds / steps


@compiled(error_model="numpy")
def _steer(
    state: Array, speed: float, turning: float, robot: Array, steps: int, step_s: float, room: Obstacles, people: Array
) -> None:
    for _ in range(steps):
        _step(state, speed, turning, robot, step_s, room, people)


@compiled(error_model="numpy")
def _step(
    state: Array, speed: float, turning: float, robot: Array, step_s: float, room: Obstacles, people: Array
) -> None:
    wanted = _within(speed, robot[1])
    state[SPEED] += _within(wanted - state[SPEED], robot[3] * step_s)
    state[TURNING] += _within(_within(turning, robot[2]) - state[TURNING], robot[4] * step_s)
    middle = state[HEADING] + 0.5 * state[TURNING] * step_s
    dx, dy = state[SPEED] * math.cos(middle) * step_s, state[SPEED] * math.sin(middle) * step_s
    turned = state[HEADING] + state[TURNING] * step_s
    state[HEADING] = turned - 2 * math.pi * math.floor((turned + math.pi) / (2 * math.pi))
    if robot[0] > 0.0 and (dx != 0.0 or dy != 0.0):
        dx, dy = _kept_off(state, dx, dy, robot, room, people)
    state[X] += dx
    state[Y] += dy
    state[DISTANCE] += math.hypot(dx, dy)


@compiled(error_model="numpy")
def _kept_off(state: Array, dx: float, dy: float, robot: Array, room: Obstacles, people: Array) -> tuple[float, float]:
    """A small motion, reduced by contact with obstacles."""
    now, away_x, away_y = nearest(room, people, state[X], state[Y])
    then = nearest(room, people, state[X] + dx, state[Y] + dy)[0]
    if then >= robot[0] or then >= now:
        if then > robot[0] + CONTACT_RELEASE_M:
            state[IN_CONTACT] = 0.0
        return dx, dy
    state[COLLISIONS] += 1.0 - state[IN_CONTACT]
    state[IN_CONTACT] = 1.0
    before = math.hypot(dx, dy)
    into = min(dx * away_x + dy * away_y, 0.0)
    dx, dy = dx - into * away_x, dy - into * away_y
    then = nearest(room, people, state[X] + dx, state[Y] + dy)[0]
    if robot[5] == 0.0 or (then < robot[0] and then < now - 1e-12):
        dx = dy = 0.0
    if math.hypot(dx, dy) < 0.1 * before:  # it stands still; along a wall it scrapes on as fast as its wheels turn
        state[SPEED] = 0.0
    return dx, dy


@compiled(error_model="numpy")
def _within(value: float, limit: float) -> float:
    return max(-limit, min(limit, value))


def drive(
    waypoints: npt.ArrayLike,
    robot: Robot,
    rate: float,
    room: Obstacles | None = None,
    kidnappings: Sequence[Kidnapping] = (),
) -> SimulatedDrive:
    """Drive along waypoints (W, 2), recorded at `rate` (Hz) from time 0.

    Pure pursuit: the robot steers for the point of the route `look_ahead` metres on, slower the more it must turn, and
    turns on the spot where it would have to look back. Speed and turning change no faster than the limits allow. The
    robot starts at rest at the first waypoint, facing the second. Obstacles stop it where `room` is given. After a
    kidnapping it continues from the nearest point of the route; of several equally near ones, as on laps, from the
    next.
    """
    points, ends = _legs(waypoints)
    length = float(ends[-1])
    start = points[0]
    ahead = points[min(1, len(points) - 1)] - start
    state = at_rest((*start, math.atan2(ahead[1], ahead[0])))
    bounds = limits(robot)
    if room is None:
        bounds[0], room = 0.0, gather(np.empty((0, 6)), (1.0, 1.0), 0.0)
    every, step_s = _divided(1.0 / rate)
    capacity = math.ceil((4.0 * length / robot.speed + 60.0) * rate) + 1
    poses = np.empty((capacity, 3))
    poses[0] = state[:3]
    rolled_to: dict[int, Array] = {}
    kidnapped: list[tuple[int, Kidnapping]] = []
    done, along, planned_m = 1, 0.0, length
    for kidnapping in [*sorted(kidnappings, key=lambda kidnapping: kidnapping.at), None]:
        until = capacity if kidnapping is None else min(capacity, round(kidnapping.at * rate) + 1)
        filled, along, arrived = _pursue(
            points, ends, along, state, bounds, robot.look_ahead, every, step_s, room, poses[done:until]
        )
        done += filled
        if arrived or kidnapping is None:
            break
        rolled_to.setdefault(done - 1, poses[done - 1].copy())
        kidnapped.append((done - 1, kidnapping))
        teleport(state, kidnapping)
        poses[done - 1] = state[:3]
        if kidnapping.to is not None:
            left, along = along, _nearest_along(points, ends, state[:2], along)
            planned_m -= along - left
    poses = poses[:done]
    before = poses.copy()
    for number, pose in rolled_to.items():
        before[number] = pose
    times, driven_m = np.arange(done) / rate, float(state[DISTANCE])
    return SimulatedDrive(
        times, poses, before, int(state[COLLISIONS]), tuple(kidnapped), driven_m, planned_m, bool(arrived)
    )


def around(state: Array, seconds: npt.ArrayLike) -> Array:
    """Poses (N, 3) of a robot some moments before and after now, with the motion that its `state` (8,) has."""
    offset = np.asarray(seconds, dtype=np.float64)
    middle = state[HEADING] + 0.5 * state[TURNING] * offset
    way = state[SPEED] * offset
    x, y = state[X] + way * np.cos(middle), state[Y] + way * np.sin(middle)
    return np.stack([x, y, state[HEADING] + state[TURNING] * offset], axis=-1)


def teleport(state: Array, kidnapping: Kidnapping) -> None:
    """Teleport a robot: its `state` (8,) is at rest afterwards, and no distance is counted."""
    state[:3] = compose(state[:3] if kidnapping.to is None else kidnapping.to, (0.0, 0.0, kidnapping.turn))
    state[SPEED] = state[TURNING] = state[IN_CONTACT] = 0.0


def _legs(waypoints: npt.ArrayLike) -> tuple[Array, Array]:
    """Points of a line of straight legs without repetitions, and their distances along it."""
    points = np.asarray(waypoints, dtype=np.float64).reshape(-1, 2)
    keep = np.concatenate([[True], (np.diff(points, axis=0) != 0.0).any(axis=1)])
    points = np.ascontiguousarray(points[keep])
    return points, distances_along(points)


def _nearest_along(points: Array, ends: Array, at: Array, along: float = 0.0) -> float:
    """Distance along the line of the point nearest to a place; of several that are about as near, the first ahead."""
    if len(points) == 1:
        return 0.0
    legs = np.diff(points, axis=0)
    part = np.clip(((at - points[:-1]) * legs).sum(axis=1) / (legs**2).sum(axis=1), 0.0, 1.0)
    off = np.hypot(*(points[:-1] + part[:, None] * legs - at).T)
    places = ends[:-1] + part * np.diff(ends)
    near = off <= off.min() + REJOIN_TOLERANCE_M
    ahead = near & (places >= along)
    first = int(np.argmax(ahead if ahead.any() else near))
    chosen = [leg for leg in range(first, len(legs)) if places[leg] - places[first] < 2 * REJOIN_TOLERANCE_M]
    return float(places[chosen[int(np.argmin(off[chosen]))]])


@compiled(error_model="numpy")
def _point(points: Array, ends: Array, along: float) -> tuple[float, float]:
    """The point `along` metres from the start of a line."""
    if len(points) == 1:
        return points[0, 0], points[0, 1]
    leg = min(max(int(np.searchsorted(ends, along)), 1), len(points) - 1)
    part = (along - ends[leg - 1]) / (ends[leg] - ends[leg - 1])
    return (
        points[leg - 1, 0] + part * (points[leg, 0] - points[leg - 1, 0]),
        points[leg - 1, 1] + part * (points[leg, 1] - points[leg - 1, 1]),
    )


@compiled(error_model="numpy")
def _pursue(
    points: Array,
    ends: Array,
    along: float,
    state: Array,
    robot: Array,
    look_ahead: float,
    every: int,
    step_s: float,
    room: Obstacles,
    poses: Array,
) -> tuple[int, float, bool]:
    """Follow a line until `poses` (N, 3) is full or the robot is there: rows filled, metres along, whether it is."""
    length = ends[-1]
    goal_x, goal_y = points[-1, 0], points[-1, 1]
    max_stalled_steps = math.ceil(
        (2 * math.pi / robot[2] + robot[2] / robot[4]) / step_s
    )  # as long as it takes to turn once
    stalled_steps = 0
    for row in range(len(poses)):
        for _ in range(every):
            best, before = np.inf, along
            ahead = along
            for step in range(16):  # on the next stretch of the line, never back
                at = min(ahead + 0.02 * step, length)
                x, y = _point(points, ends, at)
                off = math.hypot(x - state[X], y - state[Y])
                if off < best:
                    best, along = off, at
            stalled_steps = stalled_steps + 1 if along == before else 0
            if (
                stalled_steps > max_stalled_steps
            ):  # it circles round the point that it steers for, and so has been there
                along, stalled_steps = min(along + look_ahead, length), 0
            remaining = math.hypot(goal_x - state[X], goal_y - state[Y])
            arrives = along >= length - look_ahead  # else the line only comes past its end
            if arrives:
                halts = along >= length - 0.6 * ARRIVAL_M or (remaining < 2 * ARRIVAL_M and state[TURNING] == 0.0)
                if (remaining < ARRIVAL_M and state[SPEED] < 0.05) or (halts and state[SPEED] == 0.0):
                    return row, along, True
            x, y = _point(points, ends, min(along + look_ahead, length))
            off = math.atan2(y - state[Y], x - state[X]) - state[HEADING]
            off -= 2 * math.pi * math.floor((off + math.pi) / (2 * math.pi))
            brake = math.sqrt(robot[3] * max(length - along - 0.6 * ARRIVAL_M, 0.0))
            speed = min(robot[1] * max(math.cos(off), 0.0) ** 2 if abs(off) < 1.0 else 0.0, brake)
            turning = 0.0 if remaining < 2 * ARRIVAL_M and (arrives or abs(off) < 1.0) else 2.0 * off
            _step(state, speed, turning, robot, step_s, room, NO_PEOPLE)
        poses[row] = state[:3]
    return len(poses), along, False
