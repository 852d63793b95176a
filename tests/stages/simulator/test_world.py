"""Worlds: what stands where, what is free, and what a seed decides."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from world_files import DEMO, world_of

from omninav.stages.recordings.occupancy_grid import read_occupancy
from omninav.stages.simulator import textures
from omninav.stages.simulator.config import Day, WorldConfig
from omninav.stages.simulator.occupancy import write_grid
from omninav.stages.simulator.plan_image import draw_plan
from omninav.stages.simulator.world import World
from omninav.stages.values.grid import FREE, OCCUPIED


@pytest.fixture(scope="module")
def demo() -> World:
    return World(DEMO)


def test_the_empty_world_is_what_the_code_defaults_to() -> None:
    assert world_of("empty") == WorldConfig()


def test_clearance_is_the_distance_to_the_nearest_face(demo: World) -> None:
    """The first shelf spans x 2.1 to 5.3 and y 2.4 to 3.4; the west wall is at x = 0."""
    points = [(3.7, 2.0), (1.7, 2.9), (5.6, 3.8), (0.5, 3.0), (3.7, 2.9), (-1.0, 3.0)]
    np.testing.assert_allclose(demo.clearance(points), [0.4, 0.4, 0.5, 0.47, 0.0, 0.0], atol=0.031)
    np.testing.assert_array_equal(demo.is_free(points, 0.3), [True, True, True, True, False, False])


def test_mats_are_driven_over_and_lamps_driven_under(demo: World) -> None:
    assert demo.is_free([(1.2, 4.5), (4.5, 4.5)], 0.3).all()


def test_the_grid_agrees_with_clearance_and_is_what_map_server_reads(demo: World, tmp_path: Path) -> None:
    grid = read_occupancy(write_grid(demo, tmp_path))
    points = np.random.default_rng(0).uniform((0, 0), demo.config.size, (300, 2))
    states, clear = grid.cells[tuple(grid.cells_of(points).T)], demo.clearance(points)
    assert (states[clear > 0.1] == FREE).all()
    assert (clear == 0.0).sum() > 40
    assert (states[clear == 0.0] == OCCUPIED).all()
    assert (tmp_path / "map.pgm").read_bytes()[:3] == b"P5\n"


def test_the_seed_decides_the_looks() -> None:
    one, same = World(DEMO).scene, World(DEMO).scene
    other = World(dataclasses.replace(DEMO, seed=2)).scene
    for first, second in zip(one, same, strict=True):
        np.testing.assert_array_equal(first, second)
    assert not np.array_equal(one.texels, other.texels)
    assert not np.array_equal(one.tiles, other.tiles)


def test_another_day_moves_the_stated_share_of_the_goods() -> None:
    config = dataclasses.replace(DEMO, days=(Day(), Day(rearranged=0.3)))
    first, later = World(config), World(config, day=3)
    pairs = [
        (a.faces[k].tiles, b.faces[k].tiles)
        for a, b in zip(first.boxes, later.boxes, strict=True)
        if a.kind == "shelf"
        for k in range(4)
    ]
    changed = np.concatenate([(a != b).ravel() for a, b in pairs])
    assert 0.3 * 0.6 < changed.mean() < 0.3 * 1.4
    np.testing.assert_array_equal(first.scene.texels, later.scene.texels)
    np.testing.assert_array_equal(first.scene.boxes, later.scene.boxes)


def test_mip_levels_keep_the_mean() -> None:
    levels = textures.mip_levels(np.stack([textures.draw("goods", np.random.default_rng(k)) for k in range(3)]))
    assert [level.shape[1] for level in levels] == [128, 64, 32, 16, 8, 4, 2, 1]
    for level in levels:
        np.testing.assert_allclose(level.mean(axis=(1, 2)), levels[0].mean(axis=(1, 2)), atol=1.0)


@pytest.mark.parametrize("material", sorted(textures.MATERIALS))
def test_every_material_is_drawn_the_same_for_the_same_seed(material: str) -> None:
    one, same = (textures.draw(material, np.random.default_rng(5)) for _ in range(2))
    assert one.shape == (textures.SIDE, textures.SIDE, 3)
    np.testing.assert_array_equal(one, same)


def test_an_unknown_material_is_refused_with_the_known_ones() -> None:
    with pytest.raises(KeyError, match="no material 'marble'; there are: asphalt"):
        textures.draw("marble", np.random.default_rng(0))


def test_the_floor_plan_is_the_same_bytes_twice(demo: World, tmp_path: Path) -> None:
    for name in ("a.png", "b.png"):
        draw_plan(demo, tmp_path / name)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
