"""Tracks that end."""

import numpy as np
import pytest

from omninav.pipeline import Context
from omninav.stages.perturbation.lost_tracks import LoseTracks
from omninav.stages.values.homing import LOST, TRACKED, TrackedFeatures


def tracked(number: int) -> TrackedFeatures:
    rows, here = np.arange(number), np.ones((number, 3))
    return TrackedFeatures(1, rows, np.full(number, TRACKED), here[:, :2], here, here)


def test_a_share_is_lost_and_nobody_knows_where_it_is() -> None:
    ctx = Context("lost", np.random.default_rng(0))
    tracks = LoseTracks(share=1 / 3).step(ctx, tracked(3000)).tracks
    assert tracks is not None
    lost = tracks.kinds == LOST
    assert np.count_nonzero(lost) == pytest.approx(1000, abs=100)
    assert np.isnan(tracks.bearings[lost]).all()
    assert np.isfinite(tracks.bearings[~lost]).all()
    again = LoseTracks(share=1 / 3).step(ctx, tracked(3000)).tracks
    assert again is not None
    assert not np.array_equal(again.kinds, tracks.kinds)


def test_without_a_share_nothing_is_drawn() -> None:
    ctx, all_of_them = Context("lost"), tracked(5)
    assert LoseTracks().step(ctx, all_of_them).tracks is all_of_them
    assert LoseTracks(share=0.5).step(ctx, None).tracks is None
    assert not ctx.drew
