"""Features that are taken away, and tracks that end."""

import numpy as np
import pytest

from omninav.pipeline import Context
from omninav.stages.perturbation.lost_features import LostFeatures
from omninav.stages.perturbation.lost_tracks import LoseTracks
from omninav.stages.values.homing import LOST, TRACKED, TrackedFeatures
from omninav.stages.values.local_features import LocalFeatures, VerticalSegments


def view(number: int) -> LocalFeatures:
    rows = np.arange(number, dtype=np.float64)
    three = np.repeat(rows[:, None], 3, axis=1)
    looks, points = np.zeros((number, 10), np.float32), np.zeros((number, 2, 2))
    columns = VerticalSegments(rows, three[:, :2], looks, rows.astype(np.float32), points)
    return LocalFeatures(three, three[:, :2], np.zeros((number, 8), np.uint8), three.astype(np.float32), rows, columns)


def tracked(number: int) -> TrackedFeatures:
    here = np.ones((number, 3))
    return TrackedFeatures(1, np.arange(number), np.full(number, TRACKED), here[:, :2], here, here)


def test_a_share_of_features_is_taken_away_and_the_rest_keeps_its_order() -> None:
    ctx = Context("lost", np.random.default_rng(0))
    left, again = (LostFeatures(share=1 / 3).step(ctx, view(3000)).features for _ in range(2))
    assert (len(left), len(left.columns)) == pytest.approx((2000, 2000), abs=100)
    assert (np.diff(left.columns.azimuths) > 0).all()
    assert (np.diff(left.sizes) > 0).all()
    assert np.array_equal(left.bearings[:, 0], left.sizes)
    assert not np.array_equal(again.sizes[:50], left.sizes[:50])


def test_a_share_of_tracks_is_lost_and_nobody_knows_where_they_are() -> None:
    ctx = Context("lost", np.random.default_rng(0))
    left, again = (LoseTracks(share=1 / 3).step(ctx, tracked(3000)).tracks for _ in range(2))
    assert left is not None
    assert again is not None
    lost = left.kinds == LOST
    assert np.count_nonzero(lost) == pytest.approx(1000, abs=100)
    assert np.array_equal(np.isfinite(left.bearings), np.repeat(~lost[:, None], 3, axis=1))
    assert not np.array_equal(again.kinds, left.kinds)


def test_without_a_share_nothing_is_drawn() -> None:
    ctx, features, tracks = Context("lost"), view(5), tracked(5)
    assert LostFeatures().step(ctx, features).features is features
    assert LoseTracks().step(ctx, tracks).tracks is tracks
    assert LoseTracks(share=0.5).step(ctx, None).tracks is None
    assert not ctx.used_rng
