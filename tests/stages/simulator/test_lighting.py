"""Light: how it falls, what stops it, what a day does to it."""

import dataclasses
import math
import time

import numpy as np
import pytest
from world_files import DEMO

from omninav.pipeline.graph.ports import convert
from omninav.stages.simulator.bodies import Box, box_array
from omninav.stages.simulator.config import Day, Lamp, Room, WallPanel, WorldConfig
from omninav.stages.simulator.lighting import Light, contact_map, lamps_and_windows, lamps_on, light_map
from omninav.stages.simulator.world import World

CORNER = np.array([0.0, 0.0])
NOTHING = np.zeros((0, 9))


def wall(x: float, depth: float, height: float) -> Box:
    return Box("wall", (x, depth / 2), (0.1, depth / 2), 0.0, 0.0, height, ())  # type: ignore[arg-type]


def test_a_lamp_lights_the_floor_by_the_fourth_power_of_its_cosine_over_its_height_squared() -> None:
    """A panel that faces down: one cosine for its own angle, one for the floor's, two for the distance."""
    light = light_map([Light((5.0, 5.0, 3.0))], 0.0, NOTHING, 3.0, CORNER, (10.0, 10.0), 0.5)
    floor = light[0, :, :, 1]
    for column in (10, 12, 14, 16):
        off = 0.5 * column - 5.0
        cosine = 3.0 / math.hypot(off, 3.0)
        edge = 1.0 - (off / 12.0) ** 2
        assert abs(floor[10, column] / floor[10, 10] - cosine**4 * edge) < 0.02
    np.testing.assert_allclose(floor[:21, :21], floor[:21, :21].T, rtol=1e-5)


def test_the_floor_has_a_mean_of_one_with_everything_on() -> None:
    lights = [Light((x, y, 3.0)) for x in (2.0, 6.0) for y in (2.0, 6.0)]
    for ambient in (0.0, 0.45):
        light = light_map(lights, ambient, NOTHING, 3.0, CORNER, (8.0, 8.0), 0.2)
        assert abs(light[0].mean() - 1.0) < 0.02


def test_ambient_light_is_a_share_below_one_and_nothing_else_is_taken() -> None:
    _, problems = convert({"ambient": 1.0}, WorldConfig, "world")
    assert [str(problem) for problem in problems] == [
        "world.ambient: 1.0 is out of bounds, expected float >= 0 and < 1"
    ]
    lights = [Light((2.0, 2.0, 3.0))]
    assert light_map(lights, 0.999, NOTHING, 3.0, CORNER, (4.0, 4.0), 0.2)[0].mean() == pytest.approx(1.0, abs=0.05)


def test_a_wall_up_to_the_ceiling_keeps_a_room_dark_and_a_low_one_does_not() -> None:
    """Without any ambient light nothing but the lamp's own reaches round a low wall, and nothing passes a high one."""
    lights = [Light((3.0, 5.0, 3.0))]
    behind = []
    for height in (3.0, 2.0):
        light = light_map(lights, 0.0, box_array([wall(8.0, 10.0, height)]), 3.0, CORNER, (10.0, 10.0), 0.2)
        behind.append(light[0, 25, 45, 1] / light[0, 25, 15, 1])
    assert behind[0] == 0.0
    assert behind[1] > 0.02


def test_lamps_that_are_off_take_their_light_away_and_dim_days_dim_it() -> None:
    config = dataclasses.replace(
        DEMO,
        days=(Day(), Day(lamps_off=1.0, curtains=1.0), Day(light=(0.4, 0.5, 0.6))),
    )
    day, night, dusk = (World(config, number).scene.light[0].mean(axis=(0, 1)) for number in range(3))
    assert (night < 0.2 * day).all()
    np.testing.assert_allclose(dusk / day, (0.4, 0.5, 0.6), rtol=1e-4)


def test_a_world_without_lamps_has_the_light_of_its_day() -> None:
    world = WorldConfig(days=(Day(), Day(light=(0.2, 1.0, 1.5))))
    assert [np.unique(World(world, day).scene.light.reshape(-1, 3), axis=0).tolist() for day in (0, 1)] == [
        [[1.0, 1.0, 1.0]],
        [pytest.approx([0.2, 1.0, 1.5])],
    ]


def test_an_open_sky_lights_both_edges_of_any_floor_alike() -> None:
    scene = World(WorldConfig(size=(9.0, 9.0), ceiling="sky")).scene
    up = scene.light[0, :, :, 1]
    row, column = (round((4.5 - corner) / scene.light_step) for corner in scene.grid[1::-1])
    first, last = (round((y - scene.grid[1]) / scene.light_step) for y in (0.6, 8.4))
    assert up[last, column] == pytest.approx(up[first, column], rel=0.1)
    assert up[row, last] == pytest.approx(up[row, first], rel=0.1)


def test_a_days_lamps_are_named_or_hit_by_a_share() -> None:
    lamps = [Lamp((float(k), 1.0), name="kitchen" if k < 3 else f"lamp {k}") for k in range(200)]
    config = WorldConfig(lamps=tuple(lamps), days=(Day(), Day(lamps_off=("kitchen", "lamp 7")), Day(lamps_off=0.3)))
    assert all(lamps_on(lamps, config, 0))
    assert [k for k, on in enumerate(lamps_on(lamps, config, 1)) if not on] == [0, 1, 2, 7]
    assert 0.2 < 1.0 - np.mean(lamps_on(lamps, config, 2)) < 0.4
    assert lamps_on(lamps, config, 2) == lamps_on(lamps, config, 2)


def test_a_closed_curtain_keeps_a_windows_light_out() -> None:
    panes = [WallPanel((0.0, 5.0), 0.0, 2.0, 0.8, 1.4, material) for material in ("window", "curtain")]
    lit = []
    for pane in panes:
        lights = lamps_and_windows([Lamp((8.0, 5.0))], [pane], WorldConfig(size=(10.0, 10.0)), 0)
        lit.append(light_map(lights, 0.0, NOTHING, 3.2, CORNER, (10.0, 10.0), 0.2)[0, 25, 8].mean())
    assert lit[1] < 0.5 * lit[0]


def test_the_floor_is_darker_right_beside_what_stands_on_it() -> None:
    """The wall's face is at x = 4.1; 1 - 0.4 exp(-d / 0.15)."""
    left = contact_map(box_array([wall(4.0, 10.0, 1.0)]), CORNER, (10.0, 10.0), 0.1)
    for column, distance in ((42, 0.1), (45, 0.4), (60, 1.9)):
        assert abs(left[50, column] - (1.0 - 0.4 * math.exp(-distance / 0.15))) < 0.002
    assert contact_map(NOTHING, CORNER, (10.0, 10.0), 0.1).min() == 1.0


def test_a_hall_of_100_by_60_m_with_hundreds_of_lamps_is_lit_in_seconds() -> None:
    lights = [Light((4.0 * i + 2.0, 4.0 * j + 2.0, 4.0)) for i in range(25) for j in range(15)]
    walls = box_array([wall(10.0 * k, 50.0, 4.0) for k in range(1, 10)])
    light_map(lights[:1], 0.4, NOTHING, 4.0, CORNER, (2.0, 2.0), 0.2)  # compiled
    start = time.process_time()
    light = light_map(lights, 0.4, walls, 4.0, CORNER, (100.0, 60.0), 0.2)
    assert time.process_time() - start < 10.0
    assert light.nbytes < 20e6


@pytest.mark.parametrize("dark", ["kitchen", "study"])
def test_a_dark_room_beside_a_lit_one(dark: str) -> None:
    rooms = (Room("kitchen", (0.0, 0.0), (5.0, 6.0)), Room("study", (5.0, 0.0), (5.0, 6.0)))
    config = WorldConfig(size=(10.0, 6.0), rooms=rooms, days=(Day(lamps_off=(dark,)),))
    scene = World(config).scene
    row, columns = round((3.0 - scene.grid[1]) / scene.light_step), [2.5, 7.5]
    west, east = (scene.light[0, row, round((x - scene.grid[0]) / scene.light_step), 1] for x in columns)
    lit, unlit = (east, west) if dark == "kitchen" else (west, east)
    assert unlit < 0.4 * lit
