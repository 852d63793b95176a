"""Plans the path of a route through a world: a line of points around obstacles that a robot can follow."""

import math
from collections.abc import Iterator, Sequence
from functools import lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING

import cv2
import numpy as np
import numpy.typing as npt

from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.plane.se2 import distances_along, path_length

from .config import Point, Route, WorldConfig
from .layout import Aisle
from .rooms import is_open
from .streams import stream
from .world import World

if TYPE_CHECKING:
    from scipy.sparse import csr_array


CLEARANCE_M = 0.1
"""Minimum distance (m) of a path from obstacles beyond the robot's radius."""
COMFORT_DISTANCE_M = 0.6
"""Distance (m) beyond the radius from which on obstacles cost nothing."""
POINT_SPACING_M = 0.4
"""Metres between the points of a path."""
RECENT = 40
"""Largest number of aisles visited last to which a random route does not return."""
MAX_GOAL_SHIFT_M = 1.2
"""Metres by which a goal without room for the robot may be moved."""
JITTER_PERIOD_M = 2.5
"""Metres of path between two draws of the jitter."""


class UnreachableRoute(Exception):
    """A route that cannot be driven on this day; the message states why."""


def plan(world: World, route: Route) -> Array:
    """The points (W, 2) of a route around what is in the world on its day, rounded with smoothed corners.

    Where the world `drives_backwards`, laps go round the other way from the same first point, a lead-in too; all other
    routes but random ones begin at their end. All points keep the robot's radius and 0.1 m from obstacles where there
    is as much room. Points behind closed doors are left out. Raises `UnreachableRoute` if another point cannot be
    reached, or no point is left.
    """
    radius = world.config.robot.radius
    if route.kind == "waypoints":
        points = np.asarray(route.waypoints[:: -1 if world.config.drives_backwards else 1], dtype=np.float64)
        if len(points) and _straight(world, points, radius):
            return _cut(points, route.length)
    space = _free_space(world)
    goals = space.reachable(_goals(world, space, route))
    line = [np.asarray(next(goals, (math.nan, math.nan)))]
    if np.isnan(line[0]).any():
        raise UnreachableRoute(f"world '{world.config.name}': the route has no points")
    legs, done = [], 0.0
    for goal in goals:
        leg = space.between(line[-1], np.asarray(goal))
        legs.append(leg)
        line.append(leg[-1])
        done += path_length(leg)
        if route.length is not None and done >= route.length:
            break
    if not legs:
        raise UnreachableRoute(f"world '{world.config.name}': the route has only one point that can be reached")
    return _cut(space.smooth(np.concatenate([legs[0], *(leg[1:] for leg in legs[1:])])), route.length)


def left_out(world: World, route: Route) -> list[str]:
    """Rooms and points of a route that cannot be reached on the world's day."""
    rooms = [room for room in world.config.rooms if route.kind == "rooms" and room.name in (route.through or room.name)]
    points = (*route.lead_in, *route.waypoints) if world.config.day(world.day).doors < 1.0 else ()
    if not rooms and not points:
        return []
    space = _free_space(world)
    closed = [room.name for room in rooms if space.roomiest_place(room.corner, room.size) is None]
    return [*closed, *(_named(world.config, point) for point in dict.fromkeys(points) if not space.has(point))]


def jittered(world: World, line: Array, spread: float, rng: np.random.Generator) -> Array:
    """A line (W, 2) as it is driven on one day: every 2.5 m it is drawn aside, Gaussian with `spread` m in x and in y.

    Draws are cut off at two standard deviations, and the drift is linear in between: over the whole path its root mean
    square is 0.78 of `spread` (0.96 for the cut, root of 2/3 for the lines). It is smaller where it would leave less
    than 0.1 m of room. Start and end stay.
    """
    points = _resampled(line, POINT_SPACING_M)
    along = distances_along(points)
    knots = np.arange(0.0, along[-1] + 2 * JITTER_PERIOD_M, JITTER_PERIOD_M)
    draws = np.clip(rng.normal(0.0, spread, (len(knots), 2)), -2 * spread, 2 * spread)
    drift = np.stack([np.interp(along, knots, draws[:, axis]) for axis in range(2)], axis=1)
    drift *= np.clip(np.minimum(along, along[-1] - along) / JITTER_PERIOD_M, 0.0, 1.0)[:, None]
    needed = np.minimum(world.clearance(points), world.config.robot.radius + CLEARANCE_M) - 1e-9
    share = np.ones(len(points))
    for factor in (0.5, 0.5, 0.5, 0.5, 0.0):
        tight = world.clearance(points + share[:, None] * drift) < needed
        share[np.convolve(tight, np.ones(5))[2:-2] > 0] *= factor  # with the neighbours, so that the line stays smooth
    jittered_line: Array = points + share[:, None] * drift
    return jittered_line


# Goals of a route


def _goals(world: World, space: "_FreeSpace", route: Route) -> Iterator[Point]:
    """The points that a route visits, in the order in which it is driven."""
    backwards = world.config.drives_backwards
    if route.kind == "laps":
        ring, lead_in = (_other_way_round(part) if backwards else part for part in (route.waypoints, route.lead_in))
        yield from (*lead_in, *ring * route.laps, *ring[:1])
    elif route.kind == "random" or not backwards:
        yield from _listed_goals(world, space, route)
    else:
        yield from reversed(list(_listed_goals(world, space, route)))


def _other_way_round(ring: tuple[Point, ...]) -> tuple[Point, ...]:
    return ring[:1] + ring[:0:-1]


def _listed_goals(world: World, space: "_FreeSpace", route: Route) -> Iterator[Point]:
    """The points of a route that is no laps, in the order in which it is described."""
    if route.kind == "waypoints":
        yield from route.waypoints
        return
    rng = stream(world.config.draw_seed, "tour", route.kind, route.seed)
    start = route.waypoints[0] if route.waypoints else space.random_place(rng)
    yield start
    if route.kind == "rooms":
        yield from _through_rooms(world, space, route, start)
    elif route.kind == "aisles":
        yield from _through_aisles(world, route, start)
    else:
        yield from _at_random(world, space, route, start, rng)
    yield from route.waypoints[1:]


def _through_aisles(world: World, route: Route, start: Point) -> Iterator[Point]:
    """Through every aisle, the nearest first; in the next round from the other end."""
    aisles = [a for a in world.layout.aisles if not route.through or a.block in route.through]
    if not aisles:
        raise UnreachableRoute(f"world '{world.config.name}' has no aisles in {', '.join(route.through) or 'it'}")
    at = start
    entered: dict[int, int] = {}
    for _ in range(route.laps):
        left = dict(enumerate(aisles))
        while left:
            options = [
                (math.dist(at, aisle.ends[end]) + (2.0 if entered.get(number) == end else 0.0), number, end)
                for number, aisle in left.items()
                for end in ((0,) if aisle.closed else (0, 1))
            ]
            _, number, end = min(options)
            entered[number] = end
            points = list(_along_aisle(left.pop(number), end))
            yield from points
            at = points[-1]


def _along_aisle(aisle: Aisle, end: int) -> Iterator[Point]:
    """Into an aisle at one end and out at the other, or back out of a closed one."""
    (ax, ay), (bx, by) = aisle.ends[end], aisle.ends[1 - end]
    yield ax, ay
    if aisle.closed:
        length = math.hypot(bx - ax, by - ay)
        share = max(0.5, 1.0 - 1.8 / length)
        yield ax + share * (bx - ax), ay + share * (by - ay)
        yield ax, ay
    else:
        yield bx, by


def _through_rooms(world: World, space: "_FreeSpace", route: Route, start: Point) -> Iterator[Point]:
    """Into every room, the nearest by path first."""
    rooms = [room for room in world.config.rooms if not route.through or room.name in route.through]
    unknown = set(route.through) - {room.name for room in rooms}
    if unknown:
        raise UnreachableRoute(f"world '{world.config.name}' has no room {', '.join(sorted(unknown))}")
    spots = [spot for room in rooms if (spot := space.roomiest_place(room.corner, room.size)) is not None]
    at: Point = start
    while spots:
        costs = space.costs(at, spots)
        nearest = int(np.argmin(costs))
        if not math.isfinite(costs[nearest]):
            return  # behind closed doors
        at = spots.pop(nearest)
        yield at


def _at_random(
    world: World, space: "_FreeSpace", route: Route, start: Point, rng: np.random.Generator
) -> Iterator[Point]:
    """Random places, or aisles near by where there are any, up to the length that is asked for."""
    length = route.length or 100.0
    at, gone = start, 0.0
    seen: list[int] = []
    open_aisles = [k for k, aisle in enumerate(world.layout.aisles) if not aisle.closed]
    while gone < 3 * length:
        if open_aisles:
            aisles = world.layout.aisles
            near = sorted(
                (math.dist(at, aisles[k].ends[end]), k, end)
                for k in open_aisles
                if k not in seen[-min(RECENT, len(open_aisles) - 1) :] or len(open_aisles) == 1
                for end in (0, 1)
            )[:16]
            _, number, end = near[int(rng.integers(len(near)))]
            seen.append(number)
            points = list(_along_aisle(aisles[number], end))
        else:
            points = [space.random_place(rng)]
        for point in points:
            gone += math.dist(at, point)
            at = point
            yield point


# Paths over the floor


@lru_cache(maxsize=1)
def _free_space(world: World) -> "_FreeSpace":
    """Ways of the world that was asked for last: its routes share them."""
    return _FreeSpace(world)


class _FreeSpace:
    """Free cells of a world's floor as a graph: shortest ways around obstacles, and what can be reached."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._step = max(0.1, max(world.config.size) / 500.0)
        columns, rows = (math.ceil(extent / self._step) for extent in world.config.size)
        x, y = self._step * (np.arange(columns) + 0.5), self._step * (np.arange(rows) + 0.5)
        points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        self._clearance_map: Array = world.clearance(points).reshape(rows, columns)
        radius = world.config.robot.radius
        self._free = self._clearance_map > radius + CLEARANCE_M
        count, parts = cv2.connectedComponents(self._free.astype(np.uint8), connectivity=8)
        sizes = np.bincount(parts.ravel(), minlength=count)
        sizes[0] = 0
        self._reachable = parts == sizes.argmax()
        self._cost_factor = 1.0 + 3.0 * np.clip(1.0 - (self._clearance_map - radius) / COMFORT_DISTANCE_M, 0.0, 1.0)
        self._graph = self._edges()

    def _edges(self) -> "csr_array":
        """Steps to the eight neighbours, longer close to obstacles."""
        from scipy.sparse import csr_array  # slow to import: not before a route needs it

        rows, columns = self._free.shape
        number = np.arange(rows * columns).reshape(rows, columns)
        starts, ends, costs = [], [], []
        for dy, dx in ((0, 1), (1, 0), (1, 1), (1, -1)):
            a = (slice(0, rows - dy), slice(max(-dx, 0), columns - max(dx, 0)))
            b = (slice(dy, rows), slice(max(dx, 0), columns + min(dx, 0)))
            both = self._free[a] & self._free[b]
            starts.append(number[a][both])
            ends.append(number[b][both])
            costs.append((0.5 * self._step * math.hypot(dx, dy) * (self._cost_factor[a] + self._cost_factor[b]))[both])
        start, end, cost = np.concatenate(starts), np.concatenate(ends), np.concatenate(costs)
        return csr_array((cost, (start, end)), shape=(number.size, number.size))

    def _cell(self, point: npt.ArrayLike) -> int:
        """Number of the free cell nearest to a point."""
        x, y = (float(v) for v in np.asarray(point))
        columns = self._free.shape[1]
        row, column = int(y / self._step), int(x / self._step)
        for reach in (0, 2, 5, max(5, math.ceil(MAX_GOAL_SHIFT_M / self._step))):
            low = max(row - reach, 0), max(column - reach, 0)
            free = np.argwhere(self._reachable[low[0] : row + reach + 1, low[1] : column + reach + 1])
            if len(free):
                free += low
                nearest = free[np.argmin(((free - (row, column)) ** 2).sum(axis=1))]
                return int(nearest[0] * columns + nearest[1])
        name, day = self._world.config.name, self._world.day
        if self._free[low[0] : row + reach + 1, low[1] : column + reach + 1].any():
            shut = ", ".join(_closed_doors(self._world))
            raise UnreachableRoute(
                f"world '{name}': {_named(self._world.config, (x, y))} is closed off from the largest free part of the "
                f"floor on day {day} ({f'closed doors: {shut}' if shut else 'no door leads there'})"
            )
        raise UnreachableRoute(f"world '{name}': no room for the robot near ({x:g}, {y:g}) on day {day}")

    def _middle(self, cells: npt.NDArray[np.int_]) -> Array:
        rows, columns = np.divmod(cells, self._free.shape[1])
        middle: Array = self._step * (np.stack([columns, rows], axis=-1) + 0.5)
        return middle

    def reachable(self, goals: Iterator[Point]) -> Iterator[Point]:
        """Goals without those behind doors that are closed today."""
        for goal in goals:
            if self._world.config.day(self._world.day).doors == 1.0:
                self._cell(goal)
            elif not self.has(goal):
                continue
            yield goal

    def has(self, point: Point) -> bool:
        """Tells whether the robot can get near a point."""
        try:
            self._cell(point)
        except UnreachableRoute:
            return False
        return True

    def between(self, start: Array, end: Array) -> Array:
        """Points (N, 2) of a path between two points, straight where nothing is near."""
        if _straight(self._world, np.stack([start, end]), self._world.config.robot.radius + 2 * CLEARANCE_M):
            return _resampled(np.stack([start, end]), POINT_SPACING_M)
        from scipy.sparse.csgraph import dijkstra

        a, b = self._cell(start), self._cell(end)
        if a == b:
            return np.stack([start, self._middle(np.array([b]))[0]])
        limit = 4.0 * float(np.hypot(*(end - start))) + 10.0
        cost, before = dijkstra(self._graph, directed=False, indices=a, return_predecessors=True, limit=limit)
        if not np.isfinite(cost[b]):
            cost, before = dijkstra(self._graph, directed=False, indices=a, return_predecessors=True)
        if not np.isfinite(cost[b]):
            (x, y), name = end, self._world.config.name
            raise UnreachableRoute(f"world '{name}': ({x:g}, {y:g}) cannot be reached on day {self._world.day}")
        cells = [b]
        while cells[-1] != a:
            cells.append(int(before[cells[-1]]))
        path = self._middle(np.array(cells[::-1]))
        if self._world.is_free(start[None], self._world.config.robot.radius + CLEARANCE_M)[0]:
            path[0] = start
        if self._world.is_free(end[None], self._world.config.robot.radius + CLEARANCE_M)[0]:
            path[-1] = end
        return _resampled(path, POINT_SPACING_M)

    def smooth(self, line: Array) -> Array:
        """A line without its corners: each point drawn to the middle of its neighbours while there is room."""
        points = _resampled(line, POINT_SPACING_M)
        needed = np.minimum(self._clearance(points), self._world.config.robot.radius + 2 * CLEARANCE_M)
        for turn in range(60):
            inner = slice(1 + turn % 2, len(points) - 1, 2)
            count = len(points[inner])
            if count == 0:  # of two or three points all are ends in one of the turns
                continue
            before, after = points[turn % 2 :: 2][:count], points[2 + turn % 2 :: 2][:count]
            drawn = points[inner] + 0.4 * (0.5 * (before + after) - points[inner])
            back = np.einsum("ij,ij->i", points[inner] - before, after - points[inner]) < 0.0
            allowed = (self._clearance(drawn) >= needed[inner]) & ~back
            points[inner] = np.where(allowed[:, None], drawn, points[inner])
        return points

    def _clearance(self, points: Array) -> Array:
        at = (points / self._step - 0.5).astype(np.float32)
        clear = self._clearance_map.astype(np.float32)
        looked_up: Array = np.concatenate(
            [  # a remapped image has fewer than 32768 rows
                cv2.remap(clear, part[:, 0], part[:, 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE).ravel()
                for part in np.array_split(at, len(at) // 16384 + 1)
            ]
        ).astype(np.float64)
        return looked_up

    def costs(self, start: Point, points: Sequence[Point]) -> Array:
        """Costs (N,) of the shortest ways from a point to others; infinite where there is none."""
        from scipy.sparse.csgraph import dijkstra

        costs: Array = dijkstra(self._graph, directed=False, indices=self._cell(start))
        return costs[[self._cell(point) for point in points]]

    def roomiest_place(self, corner: Point, size: Point) -> Point | None:
        """The roomiest reachable place in a rectangle, not far from its middle; None where there is none."""
        low = [math.floor(v / self._step) for v in (corner[1], corner[0])]
        high = [math.ceil((v + extent) / self._step) for v, extent in ((corner[1], size[1]), (corner[0], size[0]))]
        window = (slice(low[0], high[0]), slice(low[1], high[1]))
        room = np.where(self._reachable[window], np.minimum(self._clearance_map[window], 1.5), -1.0)
        rows, columns = np.mgrid[0 : room.shape[0], 0 : room.shape[1]]
        off = np.hypot(rows - room.shape[0] / 2, columns - room.shape[1] / 2) * self._step
        best = np.unravel_index(np.argmax(np.where(room > 0, room - 0.05 * off, -9.0)), room.shape)
        if room[best] <= 0:
            return None
        return float((low[1] + best[1] + 0.5) * self._step), float((low[0] + best[0] + 0.5) * self._step)

    def random_place(self, rng: np.random.Generator) -> Point:
        """A place with some room around it."""
        roomy = np.argwhere(
            self._reachable
            & (self._clearance_map > min(COMFORT_DISTANCE_M, float(self._clearance_map[self._reachable].max()) * 0.8))
        )
        row, column = roomy[int(rng.integers(len(roomy)))]
        return float((column + 0.5) * self._step), float((row + 0.5) * self._step)


def _named(config: WorldConfig, point: Point) -> str:
    """A point, and the smallest room that it is in."""
    around = [
        (room.size[0] * room.size[1], room.name)
        for room in config.rooms
        if all(low <= at <= low + size for at, low, size in zip(point, room.corner, room.size, strict=True))
    ]
    return f"({point[0]:g}, {point[1]:g})" + (f" in {min(around)[1]}" if around else "")


def _closed_doors(world: World) -> list[str]:
    """Names of the rooms that have a closed door on the world's day."""
    config = world.config
    return [
        room.name
        for room in config.rooms
        if not all(is_open(config, room, k, world.day) for k in range(len(room.doors)))
    ]


# Lines


def _straight(world: World, points: Array, room: float) -> bool:
    """Tells whether straight lines from point to point keep as much room."""
    return bool(world.is_free(_resampled(points, 0.1), room).all())


def _resampled(points: Sequence[Point] | Array, spacing: float) -> Array:
    """A line with points no more than `spacing` apart; its corners stay."""
    corners = np.asarray(points, dtype=np.float64)
    pieces = [corners[:1]]
    for a, b in pairwise(corners):
        count = math.ceil(math.dist(a, b) / spacing - 1e-9)
        if count:
            pieces.append(a + (b - a) * (np.arange(1, count + 1) / count)[:, None])
    return np.concatenate(pieces)


def _cut(points: Array, length: float | None) -> Array:
    """The first `length` m of a line."""
    if length is None:
        return points
    along = distances_along(points)
    kept = int(np.searchsorted(along, length))
    if kept == len(points):
        return points
    end = [np.interp(length, along, points[:, axis]) for axis in range(2)]
    return np.concatenate([points[:kept], [end]])
