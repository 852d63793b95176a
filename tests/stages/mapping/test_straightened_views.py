"""Where a topological map's views were taken, straightened."""

from dataclasses import replace

import numpy as np
import pytest
from made_tour import Landmarks, along, mapped, scattered

from omninav.pipeline import Context
from omninav.stages.geometry.plane.se2 import between, chain, compose
from omninav.stages.mapping.straightened_views import StraightenViews

SQUARE = [(4.0, 4.0), (16.0, 4.0), (16.0, 16.0), (4.0, 16.0), (4.0, 4.0)]
WORLD = Landmarks(scattered(20.0, 20.0, 250))


@pytest.fixture(scope="module")
def views():
    return mapped(WORLD, [along(SQUARE + SQUARE[1:], 1.5)], truth=False).views


def bent(views):
    steps = between(views.poses[:-1], views.poses[1:]) + np.array([0.0, 0.0, 0.015])
    return replace(views, poses=np.concatenate([views.poses[:1], compose(views.poses[0], chain(steps))]))


def straightened(views):
    ctx = Context("straightened", np.random.default_rng(0))
    return StraightenViews().step(ctx, views), ctx


def error(views, truth):
    return float(np.hypot(*(views.poses - truth.poses)[:, :2].T).max())


def test_a_tour_driven_twice_is_straightened(views):
    out, ctx = straightened(bent(views))
    assert error(bent(views), views) > 3.0
    assert error(out.views, views) < 0.5 * error(bent(views), views)
    assert "closures" in ctx.facts["map_straightened"]


def test_true_poses_stay(views):
    there = replace(bent(views), pose_source="truth")
    assert straightened(there)[0].views is there


def test_a_tour_that_comes_back_to_no_place_stays():
    once = mapped(WORLD, [along(SQUARE[:3], 1.5)], truth=False).views
    out, ctx = straightened(once)
    assert out.views is once
    assert ctx.facts["map_straightened"].startswith("no: ")
