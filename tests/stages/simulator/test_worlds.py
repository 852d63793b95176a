"""The worlds that come with the project: what stands there, the space through, what days change, what a seed fixes."""

import dataclasses
import math
from collections.abc import Iterable
from functools import lru_cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from omegaconf import OmegaConf
from world_files import WORLDS, world_of

from omninav.pipeline.graph.ports import convert
from omninav.stages.geometry.plane.se2 import compose, distances_along, wrap
from omninav.stages.simulator import route_planning, simulated_recording
from omninav.stages.simulator.config import AisleBlock, Block, Day, Door, LampGrid, Room, Route, WorldConfig, mirror
from omninav.stages.simulator.layout import expand
from omninav.stages.simulator.occupancy import occupancy
from omninav.stages.simulator.plan_image import draw_plan
from omninav.stages.simulator.simulated_log import record
from omninav.stages.simulator.simulated_recording import SimulatedRecording
from omninav.stages.simulator.world import World

NAMES = sorted(path.stem for path in WORLDS.glob("*.yaml") if path.stem != "empty")
SIZES = {
    "home_store_small": (25, 10), "home_store_mid": (50, 80), "home_store": (100, 60), "office": (37, 14),
    "hall": (20, 20), "institute": (10, 15),
}  # fmt: skip


@lru_cache
def built(name: str, day: int = 0) -> World:
    return World(world_of(name), day)


@lru_cache
def planned(name: str, route: Route, day: int = 0) -> np.ndarray:
    """The line of a world's route."""
    return route_planning.plan(built(name, day), route)


def length(line: np.ndarray) -> float:
    return float(np.hypot(*np.diff(line[:, :2], axis=0).T).sum())


@pytest.mark.parametrize("name", NAMES)
def test_a_world_is_named_as_its_file_and_has_a_tour_and_a_drive(name: str) -> None:
    world = world_of(name)
    assert world.name == name
    assert {"tour", "drive"} <= set(world.routes)
    assert world.size == SIZES.get(name, world.size)


@pytest.mark.parametrize("name", NAMES)
def test_grid_and_plan_show_the_same_bodies(name: str, tmp_path: Path) -> None:
    """A body taller than half a metre is dark in the grid at its centre; free cells hold no body's centre."""
    world = built(name)
    cells, origin = occupancy(world, 0.1)
    for box in world.obstacles:
        row, column = (int((box.centre[axis] - origin[axis]) / 0.1) for axis in (1, 0))
        inside = 0 <= row < cells.shape[0] and 0 <= column < cells.shape[1]
        assert not inside or cells[row, column], box
    draw_plan(world, tmp_path / "plan.png")
    assert (tmp_path / "plan.png").stat().st_size > 10_000


@pytest.mark.parametrize("name", NAMES)
def test_tours_keep_clear_of_everything_on_the_first_and_on_the_last_day(name: str) -> None:
    config = world_of(name)
    for day in (0, len(config.days) - 1):
        world = built(name, day)
        for route in _of_each_kind(config.routes.values()):
            line = planned(name, route, day)
            driven = route_planning.jittered(world, line, config.robot.path_jitter_m, np.random.default_rng(day))
            dense = np.concatenate([a + (b - a) * np.linspace(0, 1, 5)[:, None] for a, b in pairwise(driven)])
            assert world.clearance(dense).min() > config.robot.radius
            assert length(line) > 10


def _of_each_kind(routes: Iterable[Route]) -> list[Route]:
    """The one with the most points of all routes of a kind that begin at one place: the others lie along it."""
    fullest: dict[tuple[object, ...], Route] = {}
    for route in sorted(routes, key=lambda route: (len(route.waypoints), -route.laps)):
        fullest[route.kind, route.waypoints[:1], len(route.lead_in)] = route
    return list(fullest.values())


def test_a_robot_that_would_touch_something_keeps_closer_to_its_path(monkeypatch: pytest.MonkeyPatch) -> None:
    """Behind a door of this office stands furniture, and the robot turns round in the doorway."""
    office = dataclasses.replace(world_of("office"), draw=1)
    assert SimulatedRecording(office, "tour", 3).collisions == 0
    monkeypatch.setattr(simulated_recording, "JITTER_SHARES", (1.0,))
    assert SimulatedRecording(office, "tour", 3).collisions == 1


def test_a_days_line_is_beside_the_route_by_the_stated_share_of_its_spread() -> None:
    """Root mean square of draws cut off at 2 (0.959), of straight lines between (2/3) ** 0.5: 0.783."""
    hall = World(WorldConfig(size=(1010.0, 10.0)))
    line = np.array([[5.0, 5.0], [1005.0, 5.0]])
    offs = [route_planning.jittered(hall, line, 0.1, np.random.default_rng(day))[20:-20, 1] - 5.0 for day in range(12)]
    assert np.sqrt(np.mean(np.square(offs))) == pytest.approx(0.0783, rel=0.04)


@pytest.mark.parametrize(
    ("name", "route", "least", "most"),
    [
        ("home_store", "training", 1400, 1650),
        *(("home_store", f"tt{k}", 150, 200) for k in (1, 2, 3, 4)),
        ("campus", "tour", 440, 460),
        ("home_store_mid", "training", 1900, 2100),
        ("home_store_mid", "test", 295, 305),
        ("home_store_small", "laps", 420, 450),
        ("home_store_mid", "part", 770, 820),
        ("hall", "area", 340, 380),
    ],
)
def test_routes_have_the_lengths_of_the_papers(name: str, route: str, least: float, most: float) -> None:
    assert least <= length(planned(name, world_of(name).routes[route])) <= most


def test_laps_begin_where_what_comes_first_has_led() -> None:
    open_hall = World(WorldConfig(size=(20.0, 20.0)))
    square = ((5.0, 5.0), (15.0, 5.0), (15.0, 15.0), (5.0, 15.0))
    plain = route_planning.plan(open_hall, Route(square, "laps", laps=2))
    line = route_planning.plan(open_hall, Route(square, "laps", laps=2, lead_in=((2.0, 2.0), (2.0, 5.0))))
    np.testing.assert_array_equal(line[0], (2.0, 2.0))
    assert length(line) == pytest.approx(length(plain) + 6.0, abs=1.0)


@pytest.mark.parametrize(("name", "route", "farthest"), [("hall", "area", 30.0), ("home_store_mid", "part", 30.0)])
def test_who_builds_a_map_soon_comes_back_to_where_he_has_been(name: str, route: str, farthest: float) -> None:
    """No stretch of new floor, farther than 0.6 m from any place left 6 m of way before, is longer than 30 m."""
    truth = SimulatedRecording(world_of(name), route, 0).truth[:, :2]
    way = distances_along(truth)
    known = np.array([(np.hypot(*(truth[way < way[k] - 6.0] - at).T) < 0.6).any() for k, at in enumerate(truth)])
    returns = way[np.concatenate([np.flatnonzero(known), [len(way) - 1]])]
    assert np.diff(returns).max() < farthest


@pytest.mark.parametrize(
    ("name", "route", "least", "most"),
    [("campus", "tour", 535, 555), ("office_loop", "lap", 92, 108), ("institute", "changing", 8000, 8400)],
)
def test_routes_have_as_many_images_as_those_of_the_papers(name: str, route: str, least: int, most: int) -> None:
    assert least <= len(SimulatedRecording(world_of(name), route, 0).stamps) <= most


def test_three_laps_of_four_are_slipped_on_and_one_of_ten_begins_elsewhere() -> None:
    """Porta & Kroese: four laps with three liftings; a lap cut short by a kidnapping, then nine more."""
    slip, kidnap = (SimulatedRecording(world_of("office_loop"), route, 0) for route in ("slip", "kidnap"))
    lap = len(SimulatedRecording(world_of("office_loop"), "lap", 0).stamps)
    assert len(slip.stamps) == pytest.approx(4 * lap, abs=15)
    starts = [(time - int(slip.times[0])) / 1e9 / (slip.times[-1] - slip.times[0]) * 4e9 for time, _ in slip.kidnapped]
    assert [int(start) for start in starts] == [1, 2, 3]
    assert len(kidnap.stamps) == pytest.approx(9.6 * lap, abs=0.5 * lap)
    for drive in (slip, kidnap):
        ends = compose(drive.driven[0], drive.rolled[-1])
        assert math.dist(ends[:2], drive.driven[-1, :2]) > 2.0
    row = int(np.searchsorted(kidnap.times, kidnap.kidnapped[0][0]))
    turned = wrap(kidnap.driven[row, 2] - kidnap.driven[row - 1, 2])
    assert abs(turned) == pytest.approx(math.pi, abs=0.15)


def test_the_home_store_has_more_than_40_aisles_and_training_goes_through_each() -> None:
    """An aisle is gone through where the line comes within half a metre of points all along its open part."""
    world = built("home_store")
    aisles = world.layout.aisles
    assert len(aisles) > 40
    line = planned("home_store", world.config.routes["training"])
    for aisle in aisles:
        a, b = np.array(aisle.ends)
        for share in np.linspace(0.15, 0.75, 5):
            assert np.hypot(*(line - (a + share * (b - a))).T).min() < 0.5


def test_the_second_test_tour_meets_the_most_people() -> None:
    days = world_of("home_store").days
    assert max(days, key=lambda day: day.people) is days[2]
    assert days[0].rearranged == 0.0


def test_departments_differ_in_their_goods_and_neighbouring_aisles_share_them() -> None:
    world = built("home_store")
    goods = {
        name: [set(world.goods_on(s, k)[3].ravel()) for k, s in enumerate(world.layout.shelves) if s.department == name]
        for name in ("tools", "garden")
    }
    per_department = {name: set.union(*shelves) for name, shelves in goods.items()}
    assert all(1 < len(kinds) <= world.config.assortment for kinds in per_department.values())
    assert per_department["tools"] != per_department["garden"]
    tools = goods["tools"]
    assert np.mean([len(a & b) / len(a | b) for a, b in pairwise(tools)]) > 0.7


@pytest.mark.parametrize("name", ["office", "campus", "institute", "office_loop"])
def test_rooms_differ_in_the_colours_of_walls_or_floor(name: str) -> None:
    world = built(name)
    walls = {b.look: b for b in world.layout.blocks if b.kind == "wall" and b.look.endswith(" wall")}
    assert len(walls) == sum(room.walls for room in world.config.rooms)


# Days


ROOM = Room("den", (1.0, 1.0), (6.0, 5.0), (Door("east", 2.0),), windows=("north", "west"), furniture="office")
HOUSE = WorldConfig(
    size=(14.0, 9.0),
    rooms=(ROOM,),
    aisle_blocks=(AisleBlock((8.5, 1.0), (4.5, 6.0), aisle=1.2, depth=0.6),),
    lamp_grid=LampGrid(),
    days=(Day(),),
    routes={"walk": Route(((8.0, 1.0), (8.0, 8.0)))},
)


def parts(day: Day) -> dict[str, object]:
    """What can be told apart of a house on its second day."""
    world = World(dataclasses.replace(HOUSE, days=(Day(), day)), 1)

    def kind(*names: str) -> list[tuple[object, ...]]:
        return [(b.kind, b.centre, b.half, b.yaw, b.low, b.high) for b in world.boxes if b.kind in names]

    hung = [hanging.material for hanging in world.layout.wall_panels]
    return {
        "goods": [tuple(map(tuple, face.tiles)) for b in world.boxes if b.kind == "shelf" for face in b.faces[:4]],
        "shelves": kind("shelf", "stock", "wall", "roof", "lamp"),
        "furniture": kind("furniture"),
        "doors": kind("door"),
        "curtains": hung,
    }


@pytest.mark.parametrize(
    ("day", "changed"),
    [
        (Day(), set()),
        (Day(people=5), set()),
        (Day(light=(0.5, 0.7, 1.0), lamps_off=0.5), set()),
        (Day(rearranged=0.3), {"goods"}),
        (Day(furniture=0.1), {"furniture"}),
        (Day(doors=0.0), {"doors"}),
        (Day(curtains=1.0), {"curtains"}),
    ],
)
def test_a_day_changes_what_it_says_and_nothing_else(day: Day, changed: set[str]) -> None:
    plain, other = parts(Day()), parts(day)
    assert {name for name in plain if plain[name] != other[name]} == changed


def test_days_after_the_last_are_like_the_last_but_hit_other_things() -> None:
    config = dataclasses.replace(HOUSE, days=(Day(), Day(rearranged=0.5)))
    assert config.day(7) == config.days[1]
    one, other = (
        np.concatenate([b.faces[2].tiles.ravel() for b in World(config, d).boxes if b.kind == "shelf"]) for d in (1, 7)
    )
    assert (one != other).any()


def test_a_closed_door_keeps_tours_out_and_an_open_one_lets_them_in() -> None:
    inside = Route(((8.0, 1.0), (3.5, 3.5), (8.0, 8.0)))
    config = dataclasses.replace(HOUSE, days=(Day(), Day(doors=0.0)))
    entered, kept_out = (route_planning.plan(World(config, day), inside) for day in (0, 1))
    assert (entered[:, 0] < 6.0).any()
    assert not (kept_out[:, 0] < 6.9).any()


def test_a_place_without_room_is_refused_with_its_coordinates() -> None:
    walled = dataclasses.replace(HOUSE, blocks=(Block((3.5, 8.0), (5.0, 1.9), 1.0),))
    with pytest.raises(route_planning.UnreachableRoute, match=r"no room for the robot near \(3.5, 8\)"):
        route_planning.plan(World(walled, 0), Route(((8.0, 1.0), (3.5, 8.0))))


def test_a_place_that_is_closed_off_is_refused_with_its_room_and_the_closed_doors() -> None:
    """The den is the larger part of this floor, so the passage is what is closed off."""
    passage = Room("passage", (7.0, 0.0), (2.5, 9.0), walls=False)
    den = dataclasses.replace(ROOM, corner=(0.0, 0.0), size=(7.0, 9.0))
    config = WorldConfig(size=(9.5, 9.0), rooms=(den, passage), days=(Day(doors=0.0),))
    said = r"\(8.8, 1\) in passage is closed off from .* on day 0 \(closed doors: den\)"
    with pytest.raises(route_planning.UnreachableRoute, match=said):
        route_planning.plan(World(config), Route(((8.8, 1.0),), "rooms"))


# Lay-outs


def test_a_random_route_returns_to_aisles_where_there_are_few() -> None:
    world = world_of("home_store_small")
    routes = world.routes | {"far": Route(kind="random", length=250.0)}
    far = SimulatedRecording(dataclasses.replace(world, routes=routes), "far", 0)
    assert distances_along(far.true_poses)[-1] > 200.0


def test_worlds_that_cannot_be_are_refused() -> None:
    for given, said in (
        ({"size": [0, 5]}, "size[0]: 0"),
        ({"lamp_grid": {"spacing": [3, 0.001]}}, "spacing[1]: 0.001"),
        ({"seed": -5}, "world.seed: -5 is out of bounds, expected int >= 0"),
        ({"timing": {"odometry": 2000}}, "timing.odometry: 2000.0 is out of bounds, expected float >= 1 and <= 1000"),
        ({"days": [{"people": 100000}]}, "people: 100000"),
        ({"days": [{"light": [-1, 1, 1]}]}, "light[0]: -1"),
        ({"rooms": 2 * [{"name": "den", "corner": [0, 0], "size": [3, 3]}]}, "world: rooms: two or more are named den"),
    ):
        problems = convert(given, WorldConfig, "world")[1]
        assert any(said in str(problem) for problem in problems)


def test_an_aisle_block_fills_its_rectangle_with_rows_no_closer_than_an_aisle() -> None:
    block = AisleBlock((10.0, 5.0), (20.0, 12.0), "paint", aisle=2.0, depth=1.0, cross_aisles=1)
    layout = expand(WorldConfig(size=(40.0, 30.0), aisle_blocks=(block,)))
    x = sorted({round(shelf.centre[0], 6) for shelf in layout.shelves})
    assert x[0] == pytest.approx(10.5)
    assert x[-1] == pytest.approx(29.5)
    gaps = np.diff(x) - 1.0
    assert gaps.min() >= 2.0
    np.testing.assert_allclose(gaps, gaps[0], atol=1e-5)
    assert len(layout.aisles) == 2 * (len(x) - 1)
    lows = sorted({round(s.centre[1] - s.length / 2, 6) for s in layout.shelves})
    highs = sorted({round(s.centre[1] + s.length / 2, 6) for s in layout.shelves})
    assert (lows[0], highs[-1]) == (5.0, 17.0)
    assert lows[1] - highs[0] == pytest.approx(gaps[0], abs=1e-5)


def test_a_door_cuts_both_walls_that_lie_back_to_back() -> None:
    rooms = (Room("a", (0, 0), (5, 5), (Door("east", 2.5, leaf=False),)), Room("b", (5, 0), (5, 5)))
    world = World(WorldConfig(size=(10.0, 5.0), rooms=rooms))
    line = np.stack([np.linspace(3.0, 7.0, 41), np.full(41, 2.5)], axis=1)
    np.testing.assert_allclose(world.clearance(line).min(), 0.5, atol=1e-6)
    assert world.clearance([(5.0, 1.0)])[0] == 0.0


def test_clearance_is_exact_far_from_everything() -> None:
    """Against every box of a sparse hall, one by one."""
    rng = np.random.default_rng(4)
    blocks = tuple(Block(tuple(rng.uniform(5, 55, 2)), (1.0, 0.4), 1.0, yaw=rng.uniform(0, 3)) for _ in range(5))
    world = World(WorldConfig(size=(60.0, 60.0), blocks=blocks))
    points = rng.uniform(0, 60, (400, 2))
    expected = np.minimum(points, 60 - points).min(axis=1)
    for block in blocks:
        away = points - block.centre
        cos, sin = math.cos(block.yaw), math.sin(block.yaw)
        over = np.abs(away @ [[cos, -sin], [sin, cos]]) - np.array(block.size) / 2
        expected = np.minimum(expected, np.hypot(*np.maximum(over, 0).T))
    np.testing.assert_allclose(world.clearance(points), expected, atol=1e-9)


# Bytes


def test_a_piece_of_a_log_of_rooms_is_the_same_bytes_twice(tmp_path: Path) -> None:
    config = world_of("office")
    piece = dataclasses.replace(config.routes["drive"], length=0.3)
    short = dataclasses.replace(config, routes={"piece": piece}, camera=mirror(columns=64))
    for log in ("one.mcap", "two.mcap"):
        record(SimulatedRecording(short, "piece", 1), tmp_path / log)
    assert (tmp_path / "one.mcap").read_bytes() == (tmp_path / "two.mcap").read_bytes()


def test_the_store_in_the_documentation_is_one() -> None:
    text = (WORLDS.parents[1] / "docs" / "worlds.md").read_text().split("```yaml\n")[1].split("```")[0]
    described = OmegaConf.merge(OmegaConf.load(WORLDS / "empty.yaml"), OmegaConf.create(text))
    plain = {key: value for key, value in OmegaConf.to_container(described).items() if key != "defaults"}  # type: ignore[union-attr]
    config, problems = convert(plain, WorldConfig, "world")
    assert not problems
    for day in (0, 1):
        world = World(config, day)
        for route in config.routes.values():
            assert length(route_planning.plan(world, route)) > 70
