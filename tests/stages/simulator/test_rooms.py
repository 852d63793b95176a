"""Rooms as bodies: walls cut by doors, windows, furniture."""

import re
from dataclasses import replace

import numpy as np
import pytest

from omninav.pipeline.graph.ports import convert
from omninav.stages.simulator.config import Block, Day, Door, Room, WorldConfig
from omninav.stages.simulator.rooms import DOOR_HEIGHT_M, INNER_WALL_M, doors, furnish, openings, roof, walls, windows

KITCHEN = Room(
    "kitchen", (2.0, 3.0), (4.0, 5.0), doors=(Door("south", 1.5, 1.0),), windows=("north",), furniture="kitchen"
)
WORLD = WorldConfig(rooms=(KITCHEN,), height=3.0)
DEN = {"name": "den", "corner": (8.0, 0.0), "size": (4.0, 3.0), "doors": ({"side": "east", "at": 2.5},)}


def extent(block: Block) -> tuple[float, float, float, float]:
    """The least x and y and the greatest that an upright body has, turned by multiples of 90 degrees."""
    across = abs(np.sin(block.yaw)) > 0.5
    width, depth = block.size[::-1] if across else block.size
    (x, y) = block.centre
    return x - width / 2, y - depth / 2, x + width / 2, y + depth / 2


def test_walls_leave_a_door_free_and_go_on_above_it():
    south = [wall for wall in walls(WORLD, KITCHEN, openings(WORLD)) if wall.centre[1] < 3.2]
    below = [extent(wall) for wall in south if wall.bottom_z == 0.0]
    assert sorted((round(low, 3), round(high, 3)) for low, _, high, _ in below) == [(2.0, 3.0), (4.0, 6.0)]
    (lintel,) = [wall for wall in south if wall.bottom_z > 0.0]
    assert (lintel.bottom_z, lintel.bottom_z + lintel.height) == (DOOR_HEIGHT_M, 3.0)
    assert extent(lintel)[::2] == pytest.approx((3.0, 4.0))


def test_walls_stand_within_the_rectangle_of_the_room():
    for wall in walls(WORLD, KITCHEN, openings(WORLD)):
        low_x, low_y, high_x, high_y = extent(wall)
        assert min(low_x - 2.0, low_y - 3.0, 6.0 - high_x, 8.0 - high_y) > -1e-9


def test_a_closed_door_fills_its_opening_and_an_open_one_leaves_it():
    (closed,) = doors(replace(WORLD, days=(Day(doors=0.0),)), KITCHEN, 0)
    assert extent(closed)[::2] == pytest.approx((3.0, 4.0))
    (opened,) = doors(WORLD, KITCHEN, 0)
    _, low_y, high_x, high_y = extent(opened)
    assert high_x < 3.1  # at the hinge
    assert (low_y > 3.0, high_y - low_y) == (True, pytest.approx(1.0))  # swung into the room
    assert doors(WORLD, replace(KITCHEN, doors=(Door("south", 1.5, leaf=False),)), 0) == []


def test_windows_are_on_their_side_and_beside_its_doors():
    panes = windows(KITCHEN)
    assert panes
    assert {pane.centre[1] for pane in panes} == {8.0 - INNER_WALL_M}
    assert windows(replace(KITCHEN, windows=())) == []


def test_only_a_room_lower_than_the_hall_has_a_ceiling_of_its_own():
    assert roof(KITCHEN) == []
    (ceiling,) = roof(replace(KITCHEN, height=2.5))
    assert ceiling.bottom_z == 2.5
    assert extent(ceiling) == pytest.approx((2.0, 3.0, 6.0, 8.0))


def test_furniture_stands_in_its_room_away_from_the_door_and_is_the_same_each_time():
    cuts = openings(WORLD)
    fittings = furnish(WORLD, KITCHEN, cuts, Day(), 0)
    assert len(fittings.blocks) > 3
    for block in fittings.blocks:
        low_x, low_y, high_x, high_y = extent(block)
        assert min(low_x - 2.0, low_y - 3.0, 6.0 - high_x, 8.0 - high_y) > -1e-6
        assert not (low_x < 4.0 and high_x > 3.0 and low_y < 3.6)
    assert furnish(WORLD, KITCHEN, cuts, Day(), 0) == fittings
    assert furnish(WORLD, KITCHEN, cuts, Day(furniture=0.1), 1).blocks != fittings.blocks


@pytest.mark.parametrize(
    ("world", "said"),
    [
        ({"rooms": ({**DEN, "corner": (9.0, 0.0)},)}, r"rooms\.0 \('den'\) is 1 m over the edge .* of 12 x 9 m"),
        (
            {"rooms": ({**DEN, "doors": ({"side": "east", "at": 2.8},)},)},
            r"rooms\.0 .*doors\.0: .* east wall, which is 3",
        ),
        ({"height": 0.5, "camera": {"height": 0.9}}, r"height: the ceiling is 0\.5 m high, and the camera 0\.9 m"),
        ({"camera": {"position": {"x": 0.2, "y": -0.2}}}, r"camera\.position: .* radius is 0\.25 m"),
        ({"days": ({"people": 1000},)}, r"days\.0\.people: 1000, expected at most 108"),
        ({"rooms": (DEN,), "days": ({}, {"lamps_off": ("dne",)})}, r"days\.1\.lamps_off: .* 'dne'; .*: den$"),
    ],
)
def test_what_has_no_place_in_a_world_is_said_with_its_key(world: dict[str, object], said: str):
    assert convert({"rooms": (DEN,)}, WorldConfig, "world")[1] == []
    (problem,) = convert(world, WorldConfig, "world")[1]
    assert re.search(f"^world: {said}", str(problem))
