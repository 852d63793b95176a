"""The limit that follows from how far apart unrelated views are."""

import numpy as np
import pytest

from omninav.pipeline import Context
from omninav.stages.match.unrelated_views import UnrelatedViewsLimit, YardstickViews
from omninav.stages.values.pose import Motion
from omninav.stages.values.views import Coefficients


def view(value):
    row = np.array([value], np.float32)
    return Coefficients(row, row[None])


def limits(stage, values, moved=0.1):
    first, ctx = YardstickViews(), Context("limit")
    out = [stage.step(ctx, view=view(v), motion=Motion(moved, 0.0, 0.0), first=first).limit for v in values]
    return out, ctx


def test_the_limit_is_half_the_median_distance_of_views_far_enough_apart():
    out, ctx = limits(UnrelatedViewsLimit(views=5, apart=2), [0, 1, 3, 7, 8, 100, 200])
    # Pairs two or more apart: 3; 7, 6; 8, 7, 5: medians 3, 6, 6.5.
    assert [None if one is None else one.distance for one in out] == [None, None, 1.5, 3.0, 3.25, 3.25, 3.25]
    assert [one.settled for one in out if one is not None] == [False, False, True, True, True]
    assert ctx.facts["view_limit"] == 3.25
    # From 0 the first view at 3.25 or more is 7, three steps of 0.1 m on; from 1 and from 3 it is 7 too: 0.3, 0.2, 0.1.
    assert out[-1].metres == pytest.approx(0.2)


def test_a_robot_that_stands_measures_nothing():
    out, _ = limits(UnrelatedViewsLimit(views=5, apart=2), [0, 1, 3, 7], moved=0.0)
    assert out == [None] * 4


def test_there_must_be_a_pair_that_far_apart():
    with pytest.raises(ValueError, match="apart: of 20 views none"):
        UnrelatedViewsLimit(views=20, apart=20)
