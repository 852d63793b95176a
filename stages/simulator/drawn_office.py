"""Offices and institutes whose corridors, rooms, doors, windows and pictures are drawn, with routes through rooms."""

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from omninav.pipeline import BadInput
from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.plane.se2 import path_length

from .config import Door, Kidnapping, Point, Room, Route, Side, WallPanel, WorldConfig
from .mirrored import Mirrored
from .rooms import FACING, SIDES, wall_of
from .standing_room import standing_room, within
from .streams import stream

FEW_ROOMS = 8
"""Below this number of rooms the corridor has neither branches nor a core."""
MIN_FRONT_M = 3.5
"""Least width (m) of a room along its corridor."""
MIN_ENTRY_M = 4.3
"""Least width (m) of an eastern or western wall with a door: furniture beside it begins in the corners."""
DOOR_FROM_CORNER_M = 0.9
"""Least distance (m) of a door's middle from the corner of its room."""
ROUND_LENGTH_M = (14.5, 19.0)
"""Least and greatest length of a floor whose corridor runs round a core."""
MIN_PLACES = 30
"""Places (of 0.1 m) that a robot must reach in every room, 0.3 m²; else the floor is drawn again."""
TRIES = 1000
"""Plans that are drawn at most until all rooms are wide enough, and places for a picture until one is free."""


class _Row(NamedTuple):
    """Room for rooms side by side, from x = `begin` to `end` and from y = `low` to `high`; doors open to `sides`."""

    begin: float
    end: float
    low: float
    high: float
    sides: tuple[Side, ...]


class _Floor(NamedTuple):
    """Rooms and corridors of a floor whose first corridor runs along x, and its extent."""

    rooms: list[Room]
    corridors: list[Room]
    size: Point


def drawn_office(world: WorldConfig) -> WorldConfig:
    """Another floor with rooms of the same names and kinds.

    Many rooms are along a straight corridor, one with a branch, or one that runs round a core; few are on one side of
    it or on both. Rooms that are within a larger one, their corridor, get other walls and that one other widths.
    Raises `BadInput` where rooms are along no corridor.
    """
    rng = stream(world.draw_seed, "plan")
    hall = next((room for room in world.rooms if _contains_the_others(room, world.rooms)), None)
    if hall is None:
        raise BadInput(
            f"world.plan: the rooms of world '{world.name}' are along no corridor, a room with walls: false, so no "
            "plan can be drawn; type world.plan=paper"
        )
    rooms = [room for room in world.rooms if room is not hall]
    exchanged = not hall.walls and hall.size[1] > hall.size[0]
    for _ in range(TRIES):
        if hall.walls:
            floor = _round_a_core(hall, rooms, rng)
        elif len(rooms) < FEW_ROOMS:
            floor = _few(hall, rooms, world.size, rng)
        else:
            floor = _many(hall, rooms, rng)
        size = floor.size[::-1] if exchanged else floor.size
        over = Mirrored(size, exchanged, (bool(rng.integers(2)), bool(rng.integers(2))))
        drawn = replace(world, size=size, rooms=tuple(map(over.room, (*floor.corridors, *floor.rooms))))
        places = standing_room(drawn)
        if all(len(within(places, room)) >= MIN_PLACES for room in drawn.rooms):
            break
    else:
        raise BadInput(
            f"world.plan: in no plan of world '{world.name}' all rooms can be entered; type world.plan=paper"
        )
    panels = tuple(_panels(drawn, {room.name for room in floor.corridors}, rng))
    drawn = replace(drawn, wall_panels=panels)
    routes = {name: _led(route, world, drawn, hall, places) for name, route in world.routes.items()}
    return replace(drawn, routes=routes)


def _contains_the_others(room: Room, rooms: tuple[Room, ...]) -> bool:
    """Tells whether a room is a corridor: without walls, or around all others."""
    return not room.walls or (len(rooms) > 1 and all(_holds(room, _middle(other)) for other in rooms))


def _holds(room: Room, point: Point) -> bool:
    return all(low <= at <= low + extent for low, extent, at in zip(room.corner, room.size, point, strict=True))


def _middle(room: Room) -> Point:
    return room.corner[0] + room.size[0] / 2, room.corner[1] + room.size[1] / 2


# Floors


def _many(hall: Room, rooms: list[Room], rng: np.random.Generator) -> _Floor:
    """A straight corridor, one with a branch to the north, or one round a core, each a third of the times."""
    shape = int(rng.integers(3))
    wide, south, north, core = (
        round(rng.uniform(*span), 2) for span in ((1.8, 2.4), (5.2, 6.8), (5.2, 6.8), (4.6, 6.0))
    )
    for _ in range(TRIES):
        order = [rooms[k] for k in rng.permutation(len(rooms))]
        fronts = {room.name: _front(room) * rng.uniform(0.85, 1.2) for room in order}
        total = sum(fronts.values())
        depth = round(south + wide + north, 2)
        if shape == 0:
            length = round(total / 2, 2)
            rows = [_Row(0, length, 0, south, ("north",)), _Row(0, length, south + wide, depth, ("south",))]
            corridors = [_Row(0, length, south, south + wide, ())]
        elif shape == 1:
            length = round((total + wide) / 2, 2)
            begin = rng.uniform(0.3, 0.7) * length
            rows = [
                _Row(0, length, 0, south, ("north",)),
                _Row(0, begin, south + wide, depth, ("south",)),
                _Row(begin + wide, length, south + wide, depth, ("south",)),
            ]
            corridors = [_Row(0, length, south, south + wide, ()), _Row(begin, begin + wide, south + wide, depth, ())]
        else:
            length, first, second = round((total + 2 * wide) / 3, 2), south + wide, south + wide + core
            depth = round(second + wide + north, 2)
            rows = [
                _Row(0, length, 0, south, ("north",)),
                _Row(wide, length - wide, first, second, ("south", "north")),
                _Row(0, length, second + wide, depth, ("south",)),
            ]
            corridors = [
                _Row(0, length, south, first, ()),
                _Row(0, length, second, second + wide, ()),
                _Row(0, wide, first, second, ()),
                _Row(length - wide, length, first, second, ()),
            ]
        filled = _filled(order, fronts, rows, (length, depth), rng)
        if filled is not None:
            return _Floor(filled, _corridors(hall, corridors), (length, depth))
    raise BadInput(f"world.plan: no floor plan was found for {len(rooms)} rooms; type world.plan=paper")


def _few(hall: Room, rooms: list[Room], size: Point, rng: np.random.Generator) -> _Floor:
    """A corridor with all rooms on its south side, or with the largest there and the others opposite."""
    wide = min(hall.size) * rng.uniform(0.85, 1.05)
    order = [rooms[k] for k in rng.permutation(len(rooms))]
    fronts = {room.name: max(_front(room) * rng.uniform(0.85, 1.1), MIN_ENTRY_M) for room in order}
    if rng.uniform() < 0.5:
        length, low = round(sum(fronts.values()), 2), rng.uniform(6.2, 7.2)
        depth = round(low + wide, 2)
        rows = [_Row(0, length, 0, low, ("north",))]
    else:
        order.sort(key=lambda room: -fronts[room.name])
        low, high = rng.uniform(MIN_ENTRY_M, 4.8), rng.uniform(MIN_ENTRY_M, 4.8)
        length, depth = (
            round(math.prod(size) / (low + wide + high) * rng.uniform(0.95, 1.1), 2),
            round(low + wide + high, 2),
        )
        rows = [_Row(0, length, 0, low, ("north",)), _Row(0, length, low + wide, depth, ("south",))]
    filled = _filled(order, fronts, rows, (length, depth), rng)
    if filled is None:
        raise BadInput(f"world.plan: {len(rooms)} rooms do not fit along {length:.1f} m; type world.plan=paper")
    return _Floor(filled, _corridors(hall, [_Row(0, length, low, low + wide, ())]), (length, depth))


def _filled(
    order: list[Room],
    fronts: dict[str, float],
    rows: list[_Row],
    size: Point,
    rng: np.random.Generator,
) -> list[Room] | None:
    """The rooms along the rows, each in the emptiest; None where one becomes too narrow."""
    members: list[list[Room]] = [[] for _ in rows]
    lengths = [row.end - row.begin for row in rows]
    for room in order:
        filled = [sum(fronts[each.name] for each in row) for row in members]
        members[int(np.argmin([part / whole for part, whole in zip(filled, lengths, strict=True)]))].append(room)
    placed = []
    for row, those in zip(rows, members, strict=True):
        total = sum(fronts[room.name] for room in those)
        at = row.begin
        for room in those:
            front = fronts[room.name] * (row.end - row.begin) / total
            if front < MIN_FRONT_M:
                return None
            placed.append(_placed(room, at, front, row, size, rng))
            at += front
        if not those:
            return None
    return placed


def _front(room: Room) -> float:
    """Width of a listed room along its corridor."""
    return room.size[0] if not room.doors or room.doors[0].side in ("north", "south") else room.size[1]


def _placed(room: Room, at: float, front: float, row: _Row, size: Point, rng: np.random.Generator) -> Room:
    """A room in a row: its doors somewhere to the corridor, its windows on all outer sides."""
    side = row.sides[int(rng.integers(len(row.sides)))]
    stretch = front / max(1, len(room.doors))
    doors = []
    for k, door in enumerate(room.doors):
        margin = max(DOOR_FROM_CORNER_M, door.width / 2 + 0.3)
        doors.append(replace(door, side=side, at=round(k * stretch + rng.uniform(margin, stretch - margin), 2)))
    return _walled(room, (at, row.low), (front, row.high - row.low), tuple(doors), size)


def _walled(room: Room, corner: Point, extent: Point, doors: tuple[Door, ...], size: Point) -> Room:
    outside: dict[Side, bool] = {
        "east": corner[0] + extent[0] > size[0] - 1e-6,
        "north": corner[1] + extent[1] > size[1] - 1e-6,
        "west": corner[0] < 1e-6,
        "south": corner[1] < 1e-6,
    }
    windows = tuple(side for side, is_outside in outside.items() if is_outside) if room.windows else ()
    return replace(room, corner=corner, size=extent, doors=doors, windows=windows)


def _corridors(hall: Room, places: list[_Row]) -> list[Room]:
    return [
        replace(
            hall,
            name=hall.name if k == 0 else f"{hall.name} {k + 1}",
            corner=(place.begin, place.low),
            size=(place.end - place.begin, place.high - place.low),
        )
        for k, place in enumerate(places)
    ]


def _round_a_core(hall: Room, rooms: list[Room], rng: np.random.Generator) -> _Floor:
    """A corridor of about the same length round a core that is cut into the rooms."""
    length = round(rng.uniform(*ROUND_LENGTH_M), 2)
    size = length, hall.size[0] + hall.size[1] - length
    west, east, south, north = rng.uniform(2.7, 3.2, 4)
    cores = [((west, south), (size[0] - west - east, size[1] - south - north))]
    while len(cores) < len(rooms):
        corner, extent = cores.pop(int(np.argmax([math.prod(extent) for _, extent in cores])))
        axis, share = int(extent[1] > extent[0]), rng.uniform(0.42, 0.58)
        first, second, start = list(extent), list(extent), list(corner)
        first[axis], second[axis], start[axis] = share * extent[axis], (1 - share) * extent[axis], 0.0
        start[axis] = corner[axis] + first[axis]
        cores += [(corner, (first[0], first[1])), ((start[0], start[1]), (second[0], second[1]))]
    placed = []
    for room, number in zip(rooms, rng.permutation(len(rooms)), strict=True):
        corner, extent = cores[number]
        sides: list[Side] = []
        sides += ["west"] if corner[0] < west + 1e-6 else []
        sides += ["east"] if corner[0] + extent[0] > size[0] - east - 1e-6 else []
        sides += ["south"] if corner[1] < south + 1e-6 else []
        sides += ["north"] if corner[1] + extent[1] > size[1] - north - 1e-6 else []
        if len(sides) > 1 and extent[1] < MIN_ENTRY_M:
            sides = [side for side in sides if side in ("north", "south")] or sides
        side = sides[int(rng.integers(len(sides)))]
        front = extent[0] if side in ("north", "south") else extent[1]
        doors = tuple(
            replace(door, side=side, at=round(rng.uniform(DOOR_FROM_CORNER_M, front - DOOR_FROM_CORNER_M), 2))
            for door in room.doors
        )
        placed.append(replace(room, corner=corner, size=extent, doors=doors))
    return _Floor(placed, [replace(hall, corner=(0.0, 0.0), size=size)], size)


# Pictures, notice boards and doors that lead elsewhere


def _panels(world: WorldConfig, corridors: set[str], rng: np.random.Generator) -> Iterator[WallPanel]:
    """As many panels as the listed world has, on walls that one sees from a corridor; the same kinds and sizes."""
    halls = [room for room in world.rooms if room.name in corridors]
    hung: list[Point] = []
    for panel in world.wall_panels:
        for _ in range(TRIES):
            hall = halls[int(rng.integers(len(halls)))]
            side, share = SIDES[int(rng.integers(4))], rng.uniform(0.1, 0.9)
            spot = _spot(world, hall, corridors, side, share, panel.width)
            if spot is not None and all(math.dist(spot[0], other) > 2.0 for other in hung):
                hung.append(spot[0])
                yield replace(panel, centre=spot[0], facing=spot[1])
                break


def _spot(
    world: WorldConfig, hall: Room, corridors: set[str], side: Side, share: float, width: float
) -> tuple[Point, float] | None:
    """A place on the wall beside a corridor and the direction it faces; None where no wall is, or a door."""
    wall, axis = wall_of(hall, side), 0 if side in ("north", "south") else 1
    along = wall.low + share * hall.size[axis]
    at, beyond = wall.on_map(along, wall.line), wall.on_map(along, wall.inside(-0.3))
    if not (0.0 < beyond[0] < world.size[0] and 0.0 < beyond[1] < world.size[1]):
        return None if hall.walls else (at, FACING[side])  # a walled corridor has windows there
    room = next((room for room in world.rooms if room.name not in corridors and _holds(room, beyond)), None)
    if room is None:
        return None
    place, extent = along - room.corner[axis], room.size[axis]
    doors = (door for door in room.doors if wall_of(room, door.side).along_x == wall.along_x)
    clear = all(abs(door.at - place) > (door.width + width) / 2 + 0.1 for door in doors)
    return (at, FACING[side]) if clear and width / 2 < place < extent - width / 2 else None


# Routes


def _led(route: Route, listed: WorldConfig, drawn: WorldConfig, hall: Room, places: Array) -> Route:
    """A listed route through the same rooms: each point keeps its place relative to its room's walls and door.

    Where something is there it is moved to the nearest of the `places` (N, 2) in the room.
    """

    def moved(point: Point) -> Point:
        inside = next((room for room in listed.rooms if room is not hall and _holds(room, point)), None)
        if inside is not None:
            room = next(room for room in drawn.rooms if room.name == inside.name)
            free = within(places, room)
            x, y = free[np.argmin(np.hypot(*(free - _relative(point, inside, room)).T))].tolist()
            return x, y
        new = next(room for room in drawn.rooms if room.name == hall.name)
        if not hall.walls:
            return _along(point, hall, new)
        at = point[0] * drawn.size[0] / listed.size[0], point[1] * drawn.size[1] / listed.size[1]
        return _on_the_way_round(at, drawn, hall)

    def put(kidnapping: Kidnapping) -> Kidnapping:
        if kidnapping.to is None:
            return kidnapping
        return replace(kidnapping, to=(*moved(kidnapping.to[:2]), kidnapping.to[2]))

    waypoints = tuple(map(moved, route.waypoints))
    if route.kind == "waypoints":
        waypoints = _without_detours(waypoints)
    return replace(
        route,
        waypoints=waypoints,
        laps=max(1, round(route.laps * _round(route.waypoints) / _round(waypoints)))
        if route.kind == "laps"
        else route.laps,
        lead_in=tuple(map(moved, route.lead_in)),
        kidnappings=tuple(map(put, route.kidnappings)),
    )


def _without_detours(points: tuple[Point, ...]) -> tuple[Point, ...]:
    """The same points between the same ends, each time the nearest one next."""
    first, left, last = points[:1], list(points[1:-1]), points[1:][-1:]
    while left:
        at = first[-1]
        first += (left.pop(int(np.argmin([math.dist(at, point) for point in left]))),)
    return first + last


def _round(points: tuple[Point, ...]) -> float:
    """Metres from point to point and back to the first."""
    return path_length([*points, points[0]])


def _relative(point: Point, old: Room, new: Room) -> Point:
    """A point of a room in the same room elsewhere: along the wall with the door, and away from that."""
    along, away = 0.5, 0.5
    for room in (old, new):
        side = room.doors[0].side if room.doors else "south"
        axis, far = (0, 1) if side in ("north", "south") else (1, 0), side in ("north", "east")
        if room is old:
            shares = [(point[k] - room.corner[k]) / room.size[k] for k in (0, 1)]
            along, away = shares[axis[0]], 1 - shares[axis[1]] if far else shares[axis[1]]
    shares = [along, 1 - away if far else away]
    place = [0.0, 0.0]
    for k, share in zip(axis, shares, strict=True):
        place[k] = new.corner[k] + share * new.size[k]
    return place[0], place[1]


def _along(point: Point, old: Room, new: Room) -> Point:
    """A point of a corridor in another one: as far along it and across."""
    along, across = (
        (point[k] - old.corner[k]) / old.size[k] for k in ((0, 1) if old.size[0] > old.size[1] else (1, 0))
    )
    place = (along, across) if new.size[0] > new.size[1] else (across, along)
    return new.corner[0] + place[0] * new.size[0], new.corner[1] + place[1] * new.size[1]


def _on_the_way_round(point: Point, drawn: WorldConfig, hall: Room) -> Point:
    """The nearest point of the ring in the middle of what furniture along the outer walls leaves free."""
    cores = [room for room in drawn.rooms if room.name != hall.name]
    low = np.min([room.corner for room in cores], axis=0) * 0.62
    high = drawn.size - (drawn.size - np.max([np.add(room.corner, room.size) for room in cores], axis=0)) * 0.62
    (x0, y0), (x1, y1) = low.tolist(), high.tolist()
    x, y = min(max(point[0], x0), x1), min(max(point[1], y0), y1)
    ways = ((x - x0, (x0, y)), (x1 - x, (x1, y)), (y - y0, (x, y0)), (y1 - y, (x, y1)))
    return min(ways)[1]
