"""Maps that are straightened by the places that a tour came back to."""

import numpy as np
import pytest

from omninav.pipeline import Context
from omninav.stages.geometry.plane.se2 import between, chain, compose
from omninav.stages.mapping.straightened_map import StraightenMap
from omninav.stages.values.maps import ReferenceGraph

LAP = np.concatenate([np.tile([0.2, 0.0, 0.0], (24, 1)), np.tile([0.2, 0.0, np.pi / 8], (8, 1))])
TRUTH = chain(np.tile(LAP, (4, 1))[:110])  # a stadium, one and three quarters times around


def views(poses, seed=0):
    """Histograms of 36 segments that change with position over half a metre and turn with the robot."""
    rng = np.random.default_rng(seed)
    waves, phases = rng.normal(0.0, 2.0, (2, 36, 12)), rng.uniform(0, 2 * np.pi, (36, 12))
    around = 0.1 + np.maximum(np.sin(np.tensordot(poses[:, :2], waves, 1) + phases), 0.0)
    world = around / around.sum(axis=2, keepdims=True)
    turns = np.round(poses[:, 2] / (2 * np.pi) * 36).astype(int)
    return np.stack([np.roll(view, turn, axis=0) for view, turn in zip(world, turns, strict=True)]).astype(np.float32)


def bent(source="odometry", poses=TRUTH):
    steps = between(poses[:-1], poses[1:]) + np.array([0.0, 0.0, 0.01])
    driven = np.concatenate([poses[:1], compose(poses[0], chain(steps))])
    return ReferenceGraph(driven, views(poses), "histograms", np.zeros((0, 2), np.int64), source)


def straightened(map):
    ctx = Context("straightened", np.random.default_rng(0))
    return StraightenMap().step(ctx, map, []), ctx


def error(map, poses=TRUTH):
    return float(np.hypot(*(map.poses - poses)[:, :2].T).max())


def test_a_tour_that_comes_back_is_straightened():
    out, ctx = straightened(bent())
    assert error(bent()) > 1.5
    assert error(out.map) < 0.4 * error(bent())
    assert out.metrics.values["straightened"]["closures"] > 10
    assert "closures" in ctx.facts["map_straightened"]


def test_the_map_that_went_in_stays():
    map = bent()
    before = map.poses.copy()
    straightened(map)
    assert (map.poses == before).all()


def test_true_poses_are_left_alone():
    map = bent("truth")
    out, ctx = straightened(map)
    assert out.map is map
    assert "map_straightened" not in ctx.facts


@pytest.mark.parametrize("seen", [slice(0, 25), slice(0, 5)])
def test_without_a_crossing_or_with_few_views_it_says_so(seen):
    map = bent(poses=TRUTH[seen])
    out, ctx = straightened(map)
    assert out.map is map
    assert ctx.facts["map_straightened"].startswith("no: ")
