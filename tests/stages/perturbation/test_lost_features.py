"""Features that are taken away."""

import numpy as np
import pytest

from omninav.pipeline import Context
from omninav.stages.perturbation.lost_features import LostFeatures
from omninav.stages.values.local_features import LocalFeatures


def view(number: int) -> LocalFeatures:
    rows = np.arange(number, dtype=np.float64)
    three = np.repeat(rows[:, None], 3, axis=1)
    return LocalFeatures(three, three[:, :2], np.zeros((number, 8), np.uint8), three.astype(np.float32), rows)


def test_a_share_is_taken_away_and_the_rest_keeps_its_order() -> None:
    ctx = Context("lost", np.random.default_rng(0))
    left = LostFeatures(share=1 / 3).step(ctx, view(3000)).features
    assert len(left) == pytest.approx(2000, abs=100)
    assert (np.diff(left.sizes) > 0).all()
    assert np.array_equal(left.bearings[:, 0], left.sizes)
    again = LostFeatures(share=1 / 3).step(ctx, view(3000)).features
    assert not np.array_equal(again.sizes[:50], left.sizes[:50])


def test_without_a_share_nothing_is_drawn() -> None:
    ctx, all_of_them = Context("lost"), view(5)
    assert LostFeatures().step(ctx, all_of_them).features is all_of_them
    assert not ctx.drew
