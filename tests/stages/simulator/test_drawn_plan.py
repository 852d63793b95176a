"""Floor plans that are drawn: what a robot needs of them holds in every draw, and no two are alike."""

import dataclasses
from functools import lru_cache
from itertools import pairwise

import numpy as np
import pytest
from world_files import world_of

from omninav.pipeline import BadInput
from omninav.stages.simulator import route_planning
from omninav.stages.simulator.config import Door, Kidnapping, Room, WorldConfig
from omninav.stages.simulator.drawn_plan import laid_out
from omninav.stages.simulator.mirrored import Mirrored
from omninav.stages.simulator.standing_room import standing_room, within
from omninav.stages.simulator.world import World
from omninav.stages.simulator.world_rooms import rooms_of

NAMES = ("home_store", "home_store_mid", "home_store_small", "office", "office_loop", "institute")
DRAWS = (0, 7, 8)
each_world = pytest.mark.parametrize("name", NAMES)
each_draw = pytest.mark.parametrize("draw", DRAWS)


def drawn(name: str, draw: int) -> WorldConfig:
    return dataclasses.replace(world_of(name), draw=draw, plan="drawn")


@lru_cache
def built(name: str, draw: int, day: int = 0) -> World:
    return World(drawn(name, draw), day)


def length(line: np.ndarray) -> float:
    return float(np.hypot(*np.diff(line, axis=0).T).sum())


@each_world
def test_each_draw_has_a_plan_of_its_own_and_always_the_same(name: str) -> None:
    plans = [laid_out(drawn(name, draw)) for draw in DRAWS]
    floors = [(plan.size, plan.aisle_blocks, plan.rooms, plan.routes) for plan in (world_of(name), *plans)]
    assert all(one != other for k, one in enumerate(floors) for other in floors[:k])
    assert laid_out(drawn(name, DRAWS[1])) == plans[1]
    assert laid_out(plans[1]) is plans[1]


@lru_cache
def planned(name: str, draw: int | None = None) -> dict[str, np.ndarray]:
    """The lines of a world's routes, but for those along the same aisles as another with fewer laps."""
    world = World(world_of(name)) if draw is None else built(name, draw)
    routes = {key: route for key, route in world.config.routes.items() if route.kind != "aisles" or route.laps == 1}
    return {key: route_planning.plan(world, route) for key, route in routes.items()}


@each_world
@each_draw
def test_routes_keep_clear_of_everything_and_are_about_as_long_as_the_listed(name: str, draw: int) -> None:
    world, listed = built(name, draw), planned(name)
    for route, line in planned(name, draw).items():
        dense = np.concatenate([a + (b - a) * np.linspace(0, 1, 5)[:, None] for a, b in pairwise(line)])
        assert world.clearance(dense).min() > world.config.robot.radius, route
        assert 0.6 < length(line) / length(listed[route]) < 1.6, route


@each_world
@each_draw
def test_every_room_and_every_aisle_can_be_entered(name: str, draw: int) -> None:
    """On the world's own floor, not on the grid by which plans are chosen."""
    world = built(name, draw)
    space = route_planning._FreeSpace(world)
    places = [space.roomiest_place(room.corner, room.size) for room in world.config.rooms]
    assert None not in places
    goals = [*places, *(aisle.ends[0] for aisle in world.layout.aisles)]
    start = next(iter(world.config.routes.values())).waypoints[0]
    assert np.isfinite(space.costs(start, goals)).all()


@pytest.mark.parametrize("name", ["office", "office_loop", "institute", "home_store"])
@each_draw
def test_doors_can_be_passed_and_every_room_has_lamps(name: str, draw: int) -> None:
    world = built(name, draw)
    for room in world.config.rooms:
        (x, y), (width, depth) = room.corner, room.size
        low, high = np.array([x, y]), np.array([x + width, y + depth])
        assert any((low < lamp.centre).all() and (lamp.centre < high).all() for lamp in world.layout.lamps), room.name
        for door in room.doors:
            at = {
                "north": (x + door.at, y + depth), "south": (x + door.at, y),
                "east": (x + width, y + door.at), "west": (x, y + door.at),
            }[door.side]  # fmt: skip
            assert world.clearance([at])[0] > world.config.robot.radius + route_planning.CLEARANCE_M, room.name


def test_rooms_keep_their_names_and_kinds_and_goals_are_those_of_the_drawn_plan() -> None:
    listed, plan = world_of("office"), laid_out(drawn("office", 7))
    kinds = {room.name: room.furniture for room in plan.rooms}
    assert {room.name: room.furniture for room in listed.rooms}.items() <= kinds.items()
    rooms = rooms_of(drawn("office", 7))
    assert rooms is not None
    kitchen = next(room for room in plan.rooms if room.name == "kitchen")
    np.testing.assert_allclose(rooms.corners[rooms.names.index("kitchen")][:2], kitchen.corner)


@each_draw
def test_a_route_that_is_described_by_rooms_goes_through_the_same_rooms(draw: int) -> None:
    listed, plan = world_of("institute"), laid_out(drawn("institute", draw))

    def visited(world: WorldConfig) -> set[str]:
        points = np.array(world.routes["drive"].waypoints)
        return {room.name for room in world.rooms if len(within(points, room))}

    assert visited(plan) == visited(listed)


@pytest.mark.parametrize("name", ["home_store", "home_store_mid", "home_store_small"])
@each_draw
def test_a_kidnapped_robot_is_put_down_where_it_has_room(name: str, draw: int) -> None:
    store = drawn(name, draw)
    corners = np.array([(block.corner, np.add(block.corner, block.size)) for block in store.aisle_blocks])
    among_shelves = np.random.default_rng(1).uniform(corners[:, 0].min(axis=0), corners[:, 1].max(axis=0), (300, 2))
    puts = tuple(Kidnapping(at=9.0, to=(x, y, 0.0)) for x, y in among_shelves.tolist())
    turn = Kidnapping(at=5.0, turn=1.0)
    route = dataclasses.replace(store.routes["drive"], kidnappings=(turn, *puts))
    world = World(dataclasses.replace(store, routes={**store.routes, "drive": route}))
    first, *moved = world.config.routes["drive"].kidnappings
    assert first == turn
    assert world.clearance([put.to[:2] for put in moved if put.to]).min() > world.config.robot.radius


@each_draw
def test_parts_of_a_map_are_learned_from_a_main_aisle_into_aisles_on_both_sides(draw: int) -> None:
    """The first area lies on one side of the main aisle, the second on both, the third reaches farther."""
    areas = [planned("home_store_mid", draw)[f"area_{k}"] for k in (1, 2, 3)]
    extents = [np.sort(np.ptp(area, axis=0)) for area in areas]
    assert [length(area) for area in areas] == sorted(length(area) for area in areas)
    assert extents[0][1] < extents[1][1] + 8 <= extents[2][1] + 8
    assert not np.allclose(extents[1], extents[2], atol=2.0)


def test_worlds_without_rooms_or_aisles_keep_their_plan() -> None:
    hall = drawn("hall", 7)
    assert laid_out(hall) is hall


def test_rooms_along_no_corridor_are_refused() -> None:
    rooms = tuple(Room(name, (x, 0.0), (5.0, 4.0), (Door("east", 2.0),)) for name, x in (("a", 0.0), ("b", 5.0)))
    with pytest.raises(BadInput, match=r"world\.plan.*corridor"):
        laid_out(WorldConfig(rooms=rooms, plan="drawn"))


def test_standing_room_is_connected_and_keeps_clear() -> None:
    office = laid_out(drawn("office", 8))
    places = standing_room(office)
    assert World(office).clearance(places).min() > office.robot.radius
    wall = dataclasses.replace(office.rooms[-1], doors=())
    closed = dataclasses.replace(office, rooms=(*office.rooms[:-1], wall))
    assert len(within(places, wall))
    assert not len(within(standing_room(closed), wall))


def test_a_plan_is_turned_over_with_its_doors() -> None:
    room = Room("den", (1.0, 2.0), (4.0, 3.0), (Door("south", 1.0), Door("east", 0.5)), windows=("north",))
    over = Mirrored((10.0, 20.0), flips=(True, False))
    turned = over.room(room)
    assert (turned.corner, turned.size, turned.windows) == ((5.0, 2.0), (4.0, 3.0), ("north",))
    assert [(door.side, door.at) for door in turned.doors] == [("south", 3.0), ("west", 0.5)]
    assert over.room(turned) == room
    lying = Mirrored((20.0, 10.0), exchanged=True).room(room)
    assert (lying.corner, lying.size) == ((2.0, 1.0), (3.0, 4.0))
    assert [(door.side, door.at) for door in lying.doors] == [("west", 1.0), ("north", 0.5)]
    assert Mirrored((20.0, 10.0), exchanged=True).heading(0.0) == pytest.approx(np.pi / 2)
