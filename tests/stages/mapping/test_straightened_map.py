"""Maps that are straightened by the places that a tour came back to."""

import numpy as np
import pytest
from made_references import references

from omninav.pipeline import Context
from omninav.stages.geometry.appearance.closures import closures_by_appearance
from omninav.stages.geometry.appearance.length_scale import length_scale
from omninav.stages.geometry.plane.drive_graph import straightened_drives
from omninav.stages.geometry.plane.se2 import between, chain, compose
from omninav.stages.mapping.straightened_map import StraightenMap

MIN_GAP = "omninav.stages.geometry.appearance.closures.MIN_GAP"

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
    return references(driven, views(poses), source=source)


def straightened(map):
    ctx = Context("straightened", np.random.default_rng(0))
    return StraightenMap().step(ctx, map, []), ctx


def error(map, poses=TRUTH):
    return float(np.hypot(*(map.poses - poses)[:, :2].T).max())


def test_a_tour_that_comes_back_is_straightened():
    out, _ = straightened(bent())
    assert error(bent()) > 1.5
    assert error(out.map) < 0.4 * error(bent())


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


def test_views_of_one_direction_and_places_that_are_too_near_along_the_drive_close_no_loop(monkeypatch):
    map = bent()
    window = references(map.poses, map.features[:][:, :1], source="odometry")
    out, ctx = straightened(window)
    assert out.map is window
    assert "all around" in ctx.facts["map_straightened"]
    ctx = Context("straightened")
    monkeypatch.setattr(MIN_GAP, 500.0)
    assert StraightenMap().step(ctx, map, []).map is map
    assert "no loop closure was found" in ctx.facts["map_straightened"]


def test_the_way_along_the_drive_is_what_keeps_neighbours_apart(monkeypatch):
    # The stadium is 6.4 m round: a reference and the one a round later are 6.4 m of way apart.
    map = bent()
    far = straightened(map)[0].metrics.values["straightened"]["closures"]
    monkeypatch.setattr(MIN_GAP, 1e-3)
    assert straightened(map)[0].metrics.values["straightened"]["closures"] > far


def test_fewer_references_that_look_for_others_find_fewer(monkeypatch):
    monkeypatch.setattr("omninav.stages.geometry.appearance.closures.SAMPLES", 20)
    few = straightened(bent())[0].metrics.values["straightened"]
    assert 0 < few["closures"] <= 20


def test_poses_are_those_of_odometry_and_closures_in_units_of_the_length_scale():
    map = bent()
    looks = map.features[:].copy()
    looks[60] = looks[20]  # one that is wrong
    map = references(map.poses, looks, source="odometry")
    out, ctx = straightened(map)
    unit = length_scale(map.poses, map.features, "histograms")
    steps = np.hypot(*np.diff(map.poses[:, :2], axis=0).T)
    driven = np.append(0.0, np.cumsum(steps))
    closures = closures_by_appearance(looks, "histograms", driven, unit)
    drives = np.zeros(len(looks), np.int64)
    poses, weights = straightened_drives(map.poses, drives, closures, 0.5 * unit, np.radians(5.0))
    np.testing.assert_allclose(out.map.poses, poses, atol=1e-9)
    moved = np.hypot(*(out.map.poses - map.poses)[:, :2].T)
    rejected = int((weights < 0.1).sum())
    assert out.metrics.values["straightened"] == {
        "closures": len(weights),
        "rejected": rejected,
        "moved_median_m": np.median(moved),
        "moved_max_m": moved.max(),
    }
    assert 0 < rejected < len(weights)
    assert moved[0] < 1e-6
    assert (map.poses == bent().poses).all()
    assert ctx.facts["map_straightened"] == f"by {len(weights)} closures, {moved.max():.2f} m at most"
