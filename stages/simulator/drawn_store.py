"""Stores whose main aisles, departments, shelves, office and lamps are drawn, with routes along them."""

import math
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from omninav.stages.geometry.plane.se2 import path_length

from .config import AisleBlock, Block, Door, Kidnapping, Point, Room, Route, WallPanel, WorldConfig
from .layout import expand
from .mirrored import Mirrored
from .streams import stream

DESK_ROOM_M = 3.0
"""Metres that departments keep from cash desks and listed rooms."""
MIN_DEPARTMENT_M = 5.0
"""Least side (m) of a department; smaller parts of the floor stay empty."""
LARGE_STORE = 4
"""Departments from which on a store has a sales area with an office amid it."""
MAX_PANEL_SHIFT_M = 1.2
"""Metres that a window or picture moves along its wall at most."""
ROBOT_ROOM_M = 0.5
"""Metres from the departments within which a robot is not put down but in an aisle."""
PALLET_SPACING_M = 3.4
"""Metres between the middles of pallets, in x and in y."""


class Area(NamedTuple):
    """A rectangle of the floor: from x0, y0 to x1, y1 (m)."""

    x0: float
    y0: float
    x1: float
    y1: float

    @property
    def size(self) -> Point:
        """Its extent in x and in y."""
        return self.x1 - self.x0, self.y1 - self.y0

    def holds(self, point: Point, inset: float = 0.0) -> bool:
        """Tells whether a point is in it, at least `inset` m from its edge."""
        return self.x0 + inset < point[0] < self.x1 - inset and self.y0 + inset < point[1] < self.y1 - inset

    def grown(self, by: float) -> "Area":
        """A rectangle that is larger by a distance (m) on each side."""
        return Area(self.x0 - by, self.y0 - by, self.x1 + by, self.y1 + by)


class MainAisle(NamedTuple):
    """The middle line of an aisle between two parts: at x = `at` from y = `low` to `high`, or with x and y exchanged.

    `lesser` and `greater` are the numbers of the parts beside it.
    """

    upright: bool
    at: float
    low: float
    high: float
    lesser: int
    greater: int

    def point(self, along: float, offset: float = 0.0) -> Point:
        """A point of it, or beside it."""
        return (self.at + offset, along) if self.upright else (along, self.at + offset)

    def nearest(self, point: Point) -> Point:
        """Its point that is nearest to another."""
        return self.point(min(max(point[1 if self.upright else 0], self.low), self.high))


def drawn_store(world: WorldConfig) -> WorldConfig:
    """Another store of the same size: main aisles cut the floor into departments with shelves of their own.

    Where laps lead in and out of aisles, the last main aisle has aisles on both sides. A large store that lists no room
    has a sales area with pallets and an office. Cash desks and listed rooms are mirrored with the whole floor.
    """
    rng = stream(world.draw_seed, "plan")
    over = Mirrored(world.size, flips=(bool(rng.integers(2)), bool(rng.integers(2))))
    listed = [_part(block) for block in world.aisle_blocks]
    corners = np.array([over.point(corner) for part in listed for corner in (part[:2], part[2:])])
    bounds = Area(*corners.min(axis=0).tolist(), *corners.max(axis=0).tolist())
    around = min(bounds.x0, bounds.y0, world.size[0] - bounds.x1, world.size[1] - bounds.y1)
    count = len(listed) + int(rng.integers(3) if len(listed) >= LARGE_STORE else rng.integers(2))
    inset = rng.uniform(0.0, 0.08) * around
    parts, aisles = _divided(bounds.grown(-inset), count, around * rng.uniform(0.85, 1.15), rng)
    blocks, rooms = tuple(map(over.body, world.blocks)), tuple(map(over.room, world.rooms))
    standing = [_part(room) for room in rooms] + [_footprint(block) for block in blocks]
    parts = {number: _kept_from(part, standing) for number, part in parts.items()}
    twins = aisles[-1][-2:] if aisles and any(_is_comb(route, listed) for route in world.routes.values()) else ()
    parts = {number: part for number, part in parts.items() if min(part.size) >= MIN_DEPARTMENT_M or number in twins}
    if len(listed) >= LARGE_STORE and not rooms:
        least = min(set(parts) - set(twins), key=lambda number: math.prod(parts[number].size))
        office, pallets = _sales_area(parts.pop(least), rng)
        blocks, rooms = (*blocks, *pallets), (*rooms, office)
    shelved = {number: _department(world, number, part, rng) for number, part in parts.items()}
    if twins:
        aisle, depth, upright = shelved[twins[0]].aisle, shelved[twins[0]].depth, aisles[-1].upright
        for number in twins:
            shelved[number] = replace(
                shelved[number], along="x" if upright else "y", dead_ends=0.0, aisle=aisle, depth=depth
            )
    grid = world.lamp_grid
    drawn = replace(
        world,
        aisle_blocks=tuple(shelved.values()),
        blocks=blocks,
        rooms=rooms,
        shelves=tuple(map(over.body, world.shelves)),
        wall_panels=tuple(_moved_along(over.panel(panel), world.size, rng) for panel in world.wall_panels),
        lamps=tuple(replace(lamp, centre=over.point(lamp.centre)) for lamp in world.lamps),
        lamp_grid=grid and replace(grid, spacing=(rng.uniform(0.8, 1.2) * grid.spacing[0], grid.spacing[1])),
    )
    return replace(drawn, routes={name: _led(drawn, each, world, over, aisles) for name, each in world.routes.items()})


# Departments


def _part(of: AisleBlock | Room) -> Area:
    return Area(*of.corner, of.corner[0] + of.size[0], of.corner[1] + of.size[1])


def _footprint(block: Block) -> Area:
    turned = abs(math.cos(block.yaw)) < math.sqrt(0.5)
    half = np.array(block.size[::-1] if turned else block.size) / 2
    return Area(*np.subtract(block.centre, half).tolist(), *np.add(block.centre, half).tolist())


def _divided(floor: Area, count: int, gap: float, rng: np.random.Generator) -> tuple[dict[int, Area], list[MainAisle]]:
    """A floor cut into `count` parts with aisles of `gap` m between: the largest part is cut each time."""
    parts, aisles = {0: floor}, []
    for number in range(1, count):
        cut = max(parts, key=lambda each: math.prod(parts[each].size))
        part, (width, depth) = parts[cut], parts[cut].size
        upright = width > depth if max(width, depth) > 1.5 * min(width, depth) else rng.uniform() < 0.5
        at = (part.x0 + rng.uniform(0.4, 0.6) * width) if upright else (part.y0 + rng.uniform(0.4, 0.6) * depth)
        low, high = (part.y0, part.y1) if upright else (part.x0, part.x1)
        if upright:
            parts[cut], parts[number] = part._replace(x1=at - gap / 2), part._replace(x0=at + gap / 2)
        else:
            parts[cut], parts[number] = part._replace(y1=at - gap / 2), part._replace(y0=at + gap / 2)
        aisles.append(MainAisle(upright, at, low - gap / 2, high + gap / 2, cut, number))
    return parts, aisles


def _kept_from(part: Area, standing: list[Area]) -> Area:
    """A part less what is too close to other things: on the side where that takes the least away."""
    for thing in standing:
        near = thing.grown(DESK_ROOM_M)
        if part.x0 < near.x1 and near.x0 < part.x1 and part.y0 < near.y1 and near.y0 < part.y1:
            rests = (
                part._replace(x0=near.x1),
                part._replace(x1=near.x0),
                part._replace(y0=near.y1),
                part._replace(y1=near.y0),
            )
            part = max(rests, key=lambda rest: min(rest.size) > 0 and math.prod(rest.size))
    return part


def _department(world: WorldConfig, number: int, part: Area, rng: np.random.Generator) -> AisleBlock:
    """Shelves on a part, with aisles about as wide as in a listed department, and cross aisles where they are long."""
    like = world.aisle_blocks[number % len(world.aisle_blocks)]
    along = 0 if rng.uniform() < 0.5 else 1
    depth, aisle = like.depth * rng.uniform(0.85, 1.0), like.aisle * rng.uniform(0.85, 1.0)
    return replace(
        like,
        name=like.name if number < len(world.aisle_blocks) else f"department {number}",
        corner=part[:2],
        size=part.size,
        along="x" if along == 0 else "y",
        aisle=aisle,
        depth=depth,
        cross_aisles=max(0, round(part.size[along] / rng.uniform(12.0, 18.0)) - 1),
    )


def _moved_along(panel: WallPanel, size: Point, rng: np.random.Generator) -> WallPanel:
    """A picture or window elsewhere on its wall; doors stay."""
    if panel.material == "door":
        return panel
    axis = 0 if abs(math.sin(panel.facing)) > 0.5 else 1
    centre, half = list(panel.centre), panel.width / 2
    centre[axis] = min(max(centre[axis] + rng.uniform(-MAX_PANEL_SHIFT_M, MAX_PANEL_SHIFT_M), half), size[axis] - half)
    return replace(panel, centre=(centre[0], centre[1]))


def _sales_area(part: Area, rng: np.random.Generator) -> tuple[Room, list[Block]]:
    """A part without shelves: an office in one corner, and pallets in rows."""
    width, depth = (min(rng.uniform(4.0, 7.0), 0.6 * extent) for extent in part.size)
    x = part.x0 if rng.uniform() < 0.5 else part.x1 - width
    y = part.y0 if rng.uniform() < 0.5 else part.y1 - depth
    side, along = (("south", width), ("north", width), ("west", depth), ("east", depth))[int(rng.integers(4))]
    doors = (Door(side, round(rng.uniform(0.9, along - 0.9), 2)),)  # type: ignore[arg-type]
    office = Room("store office", (x, y), (width, depth), doors, furniture="office", furniture_density=0.5, height=3.0)
    columns, rows = (max(1, round(extent / PALLET_SPACING_M)) for extent in part.size)
    pallets = []
    for number in range(columns * rows):
        column, row = number % columns, number // columns
        centre = (
            part.x0 + part.size[0] * (column + 0.5) / columns,
            part.y0 + part.size[1] * (row + 0.5) / rows,
        )
        there, height, kind = rng.uniform() < 0.7, rng.uniform(0.5, 1.3), rng.integers(6)
        yaw = 0.0 if rng.uniform() < 0.5 else math.pi / 2
        if there and not _part(office).grown(1.8).holds(centre):
            pallets.append(Block(centre, (1.2, 0.8), height, "carton", "carton", yaw=yaw, look=f"pallet {kind}"))
    return office, pallets


# Routes


def _led(drawn: WorldConfig, route: Route, listed: WorldConfig, over: Mirrored, aisles: list[MainAisle]) -> Route:
    """A listed route on the drawn floor, which is mirrored to it.

    Points in the listed main aisles go to the nearest place in a drawn one, as do those at which a kidnapped robot is
    put down among shelves. Laps that go in and out of aisles do so on both sides of the last main aisle.
    """
    departments = [_part(block) for block in listed.aisle_blocks]
    outline = np.array(departments)
    bounds = Area(*outline[:, :2].min(axis=0).tolist(), *outline[:, 2:].max(axis=0).tolist())

    def moved(points: tuple[Point, ...]) -> tuple[Point, ...]:
        there: list[Point] = []
        for point in points:
            new = over.point(point)
            if aisles and bounds.holds(point):
                new = min((aisle.nearest(new) for aisle in aisles), key=lambda near: math.dist(near, new))
            there += [new] if not there or math.dist(new, there[-1]) > 1.0 else []
        return tuple(there)

    def put(kidnapping: Kidnapping) -> Kidnapping:
        if kidnapping.to is None:
            return kidnapping
        x, y, heading = kidnapping.to
        new = over.point((x, y))
        if bounds.grown(ROBOT_ROOM_M).holds((x, y)):
            near = [aisle.nearest(new) for aisle in aisles] or [aisle.ends[0] for aisle in expand(drawn).aisles]
            new = min(near, key=lambda point: math.dist(point, new))
        return replace(kidnapping, to=(*new, over.heading(heading)))

    route = replace(route, kidnappings=tuple(map(put, route.kidnappings)))
    if aisles and _is_comb(route, departments):
        return _comb(drawn, route, aisles[-1])
    return replace(route, waypoints=moved(route.waypoints), lead_in=moved(route.lead_in))


def _is_comb(route: Route, departments: list[Area]) -> bool:
    """Tells whether laps lead into aisles."""
    return route.kind == "laps" and any(part.holds(at, 0.5) for part in departments for at in route.waypoints)


def _comb(drawn: WorldConfig, route: Route, spine: MainAisle) -> Route:
    """Laps along a main aisle and from it into its aisles and back, as far and as long as the listed laps."""
    listed = np.array(route.waypoints)
    reaches = listed[0, 0] - listed[:, 0].min(), listed[:, 0].max() - listed[0, 0]
    parts = [_part(block) for block in drawn.aisle_blocks]
    beside = [
        next(part for part in parts if part.grown(0.1).holds(spine.point(spine.high - 4.0, side))) for side in (-4, 4)
    ]
    gap = 2 * min(abs(edge - spine.at) for part in beside for edge in (part[::2] if spine.upright else part[1::2]))
    depths = [part.size[0 if spine.upright else 1] + gap for part in beside]
    left, right = (min(reach, depth) for reach, depth in zip(reaches, depths, strict=True))
    along = 1 if spine.upright else 0
    names = {block.name for block in drawn.aisle_blocks if _part(block) in beside}
    stops = sorted({round(a.ends[0][along], 2) for a in expand(drawn).aisles if a.block in names})
    middle = spine.point((spine.low + spine.high) / 2)
    points = [middle, spine.point(spine.high), spine.point(spine.low)]
    length = path_length([*listed, listed[0]]) * route.laps
    while sum(math.dist(a, b) for a, b in pairwise(points)) < length:
        for stop in stops:
            sides = [spine.point(stop, side) for side in (right, -left) if abs(side) > 1.0]
            points += [spine.point(stop), *sides, spine.point(stop)]
        stops = stops[::-1]
    return replace(route, waypoints=tuple(points), laps=1, length=length)
