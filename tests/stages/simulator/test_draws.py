"""Draws of a world: new seeds, the other way round on even ones."""

from dataclasses import replace

import numpy as np
import pytest

from omninav.stages.simulator import route_planning
from omninav.stages.simulator.config import AisleBlock, Kidnapping, Route, WorldConfig, mirror
from omninav.stages.simulator.simulated_recording import SimulatedRecording
from omninav.stages.simulator.world import World

SQUARE = ((3.0, 3.0), (9.0, 3.0), (9.0, 7.0), (3.0, 7.0))
HALL = WorldConfig(
    seed=4,
    camera=mirror(64),
    routes={
        "path": Route(SQUARE),
        "laps": Route(SQUARE, "laps", laps=2, lead_in=((1.0, 1.0), (1.0, 5.0), (3.0, 5.0))),
        "carried": Route(SQUARE, kidnappings=(Kidnapping(at=3.0, to=(6.0, 4.0, 1.0)), Kidnapping(at=9.0, turn=0.5))),
    },
)
STORE = replace(HALL, aisle_blocks=(AisleBlock((2.0, 2.0), (8.0, 5.0), aisle=1.5),))


def test_a_draw_is_the_world_of_another_seed() -> None:
    first, again = SimulatedRecording(replace(HALL, draw=3), "path", 0), replace(HALL, seed=3004)
    np.testing.assert_array_equal(first.odometry, SimulatedRecording(again, "path", 0).odometry)
    np.testing.assert_array_equal(first.image(2), SimulatedRecording(again, "path", 0).image(2))
    assert not np.array_equal(first.odometry[:9], SimulatedRecording(HALL, "path", 0).odometry[:9])
    assert first.name == "empty, draw 3, route path, day 0"


@pytest.mark.parametrize("draw", [0, 1, 3, 5])
def test_development_and_odd_draws_are_driven_as_described(draw: int) -> None:
    line = route_planning.plan(World(replace(HALL, draw=draw)), HALL.routes["path"])
    np.testing.assert_array_equal(line, SQUARE)


@pytest.mark.parametrize("draw", [2, 4, 6])
def test_on_even_draws_a_path_is_driven_from_its_end(draw: int) -> None:
    world = replace(replace(HALL, draw=draw), draw=draw)  # twice is not back again
    np.testing.assert_array_equal(route_planning.plan(World(world), HALL.routes["path"]), SQUARE[::-1])


def test_on_even_draws_laps_go_round_the_other_way_from_the_same_point() -> None:
    there, back = (route_planning.plan(World(replace(HALL, draw=draw)), HALL.routes["laps"]) for draw in (1, 2))
    np.testing.assert_array_equal(there[0], back[0])
    assert _turn(there[len(there) // 3 :]) == pytest.approx(-_turn(back[len(back) // 3 :]), abs=0.4)
    assert _turn(there[len(there) // 3 :]) > 2 * np.pi


def test_on_even_draws_aisles_are_driven_from_their_end() -> None:
    ends = [(1.0, 1.0), (11.0, 8.0)]
    route = Route((ends[0], ends[1]), "aisles")
    lines = [route_planning.plan(World(replace(STORE, draw=draw)), route) for draw in (1, 2)]
    for line, (start, end) in zip(lines, (ends, ends[::-1]), strict=True):
        np.testing.assert_allclose(line[[0, -1]], [start, end], atol=0.3)


def test_who_is_carried_on_an_even_draw_is_put_down_facing_the_other_way() -> None:
    carried, turned = SimulatedRecording(replace(HALL, draw=2), "carried", 0).kidnappings
    assert carried.to == pytest.approx((6.0, 4.0, 1.0 - np.pi))
    assert turned == Kidnapping(at=9.0, turn=0.5)


def _turn(line: np.ndarray) -> float:
    """By how much (rad) a line turns left in all."""
    headings = np.unwrap(np.arctan2(*np.diff(line, axis=0).T[::-1]))
    return float(headings[-1] - headings[0])
