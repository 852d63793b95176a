"""Views around a target, of a simulated world and of a log."""

import math
from dataclasses import replace

import numpy as np
import pytest
from conftest import DATA, needs_data
from world_files import DEMO

from omninav.pipeline import Context
from omninav.stages.recordings.recording import UnreadableRecording
from omninav.stages.simulator.config import mirror
from omninav.stages.simulator.world import World
from omninav.stages.source.homing_grid import HomingGrid, HomingGridState, grid_around, in_sight

WORLD = replace(DEMO, camera=mirror(columns=64))
START = WORLD.routes["drive"].waypoints[0]
ANTWORLD = DATA / "antworld-rendered" / "grid_200mm"


def ticks(source: HomingGrid, seed: int = 0) -> list[HomingGrid.Out]:
    ctx, placed = Context("source", np.random.default_rng(seed)), HomingGridState()
    source.setup(ctx)
    found = []
    while (out := source.step(ctx, placed)) is not None:
        found.append(out)
    assert len(found) == source.length()
    return found


def test_a_grid_is_round_and_leaves_its_middle_out() -> None:
    points = grid_around((3.0, 1.0, 0.0), 1.0, 2.0)
    assert len(points) == 12  # of the 5 x 5 around it those within 2 m
    assert np.hypot(*(points - (3.0, 1.0)).T).max() == 2.0
    assert (points == (3.0, 1.0)).all(axis=1).sum() == 0


def test_the_target_is_first_and_all_others_stand_in_free_places_that_it_is_seen_from() -> None:
    found = ticks(HomingGrid(world=WORLD, target=(*START, 0.3), radius_m=3.0))
    assert (found[0].truth.x, found[0].truth.y, found[0].truth.heading) == (*START, 0.3)
    assert [out.tick.first_of_log for out in found] == [True] + [False] * (len(found) - 1)
    world, spots = World(WORLD, 0), np.array([(out.truth.x, out.truth.y) for out in found])
    assert len(found) > 5
    assert world.is_free(spots, WORLD.robot.radius).all()
    assert in_sight(world, START, spots[1:]).all()
    assert len({round(out.truth.heading, 6) for out in found}) == len(found)  # each looks another way
    assert found[0].image.pixels.shape == (48, 64, 3)


def test_the_same_seed_gives_the_same_views() -> None:
    one, other, third = (ticks(HomingGrid(world=WORLD, target=(*START, 0.3), radius_m=1.0), seed) for seed in (0, 0, 1))
    assert (one[1].image.pixels == other[1].image.pixels).all()
    assert one[1].truth.heading != third[1].truth.heading


def test_a_drawn_target_is_free_and_another_for_each_seed_and_draw() -> None:
    other_world = replace(WORLD, draw=1)
    found = []
    for world, seed in ((WORLD, 0), (WORLD, 0), (WORLD, 1), (other_world, 0)):
        target = ticks(HomingGrid(world=world, target="drawn", radius_m=1.0), seed)[0].truth
        assert World(world, 0).is_free([(target.x, target.y)], world.robot.radius).all()
        found.append((target.x, target.y, target.heading))
    assert found[0] == found[1]
    assert len(set(found)) == 3


def test_a_target_without_room_is_refused() -> None:
    wall = (0.0, 0.0, 0.0)
    with pytest.raises(UnreadableRecording, match="no room for the robot at 0, 0"):
        HomingGrid(world=WORLD, target=wall).setup(Context("source", np.random.default_rng(0)))


@needs_data
def test_of_a_log_the_target_is_the_image_taken_closest() -> None:
    source = HomingGrid(log=f"antworld:{ANTWORLD}", target=(5.9, 4.5, 0.0), radius_m=0.5)
    found = ticks(source)
    assert math.hypot(found[0].truth.x - 5.9, found[0].truth.y - 4.5) < 0.15
    metres = [math.hypot(out.truth.x - found[0].truth.x, out.truth.y - found[0].truth.y) for out in found[1:]]
    assert 0.0 < min(metres) <= max(metres) <= 0.5
