"""Where a topological map's views were taken, straightened."""

from dataclasses import replace

import numpy as np
import pytest
from made_tour import Landmarks, along, mapped, scattered
from made_views import between_looks, made_views

from omninav.pipeline import Context
from omninav.stages.geometry.plane.drive_graph import Closures, straightened_drives
from omninav.stages.geometry.plane.se2 import between, chain, compose
from omninav.stages.mapping.straightened_views import StraightenViews

MIN_GAP = "omninav.stages.mapping.straightened_views.MIN_GAP"

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
    out, _ = straightened(bent(views))
    assert error(bent(views), views) > 3.0
    assert error(out.views, views) < 0.5 * error(bent(views), views)


def test_true_poses_stay(views):
    there = replace(bent(views), pose_source="truth")
    assert straightened(there)[0].views is there


def test_a_tour_that_comes_back_to_no_place_stays():
    once = mapped(WORLD, [along(SQUARE[:3], 1.5)], truth=False).views
    out, ctx = straightened(once)
    assert out.views is once
    assert ctx.facts["map_straightened"].startswith("no: ")


def test_a_long_stop_does_not_keep_a_tour_from_being_straightened(views):
    once = bent(views)
    stop, go = np.zeros(len(views) + 8, np.int64), np.arange(len(views))
    rows = np.append(stop, go)
    distances, shares = once.distances[rows][:, rows], once.shares[rows][:, rows]
    waited = replace(
        once,
        features=tuple(once.features[row] for row in rows),
        descriptors=tuple(once.descriptors[row] for row in rows),
        poses=once.poses[rows],
        frames=np.arange(len(rows)),
        orders=np.arange(len(rows)),
        tours=once.tours[rows],
        owners=once.owners[rows],
        distances=distances,
        shares=shares,
    )
    out, _ = straightened(waited)
    found = replace(waited, poses=views.poses[rows])
    assert error(out.views, found) < 0.5 * error(waited, found)


def test_views_of_one_spot_and_a_single_view_stay():
    still = mapped(WORLD, [along(SQUARE[:2], 1.5)[:1] * 30], truth=False).views
    assert straightened(still)[0].views is still
    lone = mapped(WORLD, [along(SQUARE[:2], 1.5)[:1]], truth=False).views
    out, ctx = straightened(lone)
    assert out.views is lone
    assert not ctx.facts


def closures(looks, tours=None):
    """Number of closures of views a metre apart of which two that follow each other are usually 1 apart in looks."""
    made = made_views(between_looks(looks), tours=tours)
    ctx = Context("straightened", np.random.default_rng(0))
    metrics = StraightenViews().step(ctx, made).metrics
    return 0 if metrics is None else metrics.values["straightened"]["closures"]


def test_a_closure_is_as_alike_as_two_that_follow_each_other_and_some_views_apart(monkeypatch):
    monkeypatch.setattr(MIN_GAP, 4)
    # There and back again: the limit is 1. On the way back each view has its place on the way there.
    looks = [0, 1, 2, 3, 4, 5, 6, 7, 8, 7, 6, 5, 4, 3, 2, 1, 0]
    assert closures(looks) == 7  # views 10 to 16; 9 is 2 after 7, and 5 is not alike
    monkeypatch.setattr(MIN_GAP, 12)
    assert closures(looks) == 3  # views 14 to 16; 12 before 13 is a look of 1 for one of 3


def test_ten_views_further_on_none_is_a_neighbour():
    assert closures([*range(10), 0]) == 1
    assert closures([*range(9), 0]) == 0


def test_tours_that_look_elsewhere_are_not_moved_by_the_others(monkeypatch):
    monkeypatch.setattr(MIN_GAP, 2)
    first, second = [0, 1, 2, 3, 4, 5], [100, 101, 102, 103]
    assert closures(first + second, [1] * 6 + [2] * 4) == 0
    ctx = Context("straightened", np.random.default_rng(0))
    StraightenViews().step(ctx, made_views(between_looks(first + second), tours=[1] * 6 + [2] * 4))
    assert "of 2 tours number 2 shows no place of the first" in ctx.warnings[0]


def test_views_in_turn_that_have_nothing_in_common_do_not_say_what_is_usual(monkeypatch):
    monkeypatch.setattr(MIN_GAP, 4)
    there = [0, 1, 2, 3, 4, 5, 6, 7, 8]
    distances = between_looks([*there, 0.5, 1.5, 2.5, 3.5])
    distances[8, 9] = distances[9, 8] = np.inf
    out = StraightenViews().step(Context("straightened"), made_views(distances))
    assert out.metrics.values["straightened"]["closures"] == 4


def test_poses_are_those_of_odometry_and_closures_in_units_of_the_way_between_views(monkeypatch):
    monkeypatch.setattr(MIN_GAP, 4)
    # Twice round eight views, 1.5, 2.5, 1.5, … and last 2 m from view to view, by odometry that turns too far.
    ways = [1.5, 2.5] * 7 + [2.0]
    around = chain(np.array([(0.0, 0.0, 0.0), *[(way, 0.0, np.pi / 4 + 0.03) for way in ways]]))
    made = made_views(between_looks(list(range(8)) * 2), poses=around)
    out, ctx = straightened(made)
    closures = Closures(np.array([(n, n + 8) for n in range(8)]), np.zeros(8))
    poses, weights = straightened_drives(around, np.zeros(16, np.int64), closures, 0.5 * 2.0, np.radians(5.0))
    np.testing.assert_allclose(out.views.poses, poses, atol=1e-9)
    moved = np.hypot(*(poses - around)[:, :2].T)
    assert out.metrics.values["straightened"] == {
        "closures": 8,
        "rejected": (weights < 0.1).sum(),
        "moved_rms_m": pytest.approx(np.sqrt((moved**2).mean())),
        "moved_max_m": pytest.approx(moved.max()),
    }
    assert ctx.facts["map_straightened"] == f"by 8 closures, {moved.max():.2f} m at most"
