"""The limit between views of one place, measured on made views whose distances are known."""

from typing import Any

import numpy as np
import pytest

from omninav.pipeline import Context
from omninav.stages.match.view_limit import FirstViews, FirstViewsLimit, FixedLimit
from omninav.stages.values.pose import Motion
from omninav.stages.values.views import Coefficients, ViewLimit


def at(place: float) -> Coefficients:
    """A view whose distance to another is that of their places."""
    values = np.array([place, 0.0], np.float32)
    return Coefficients(values, values[None])


def limits(stage: FirstViewsLimit, places: list[float], metres: float = 0.1) -> tuple[list[ViewLimit | None], Context]:
    context, state = Context("limit"), FirstViews()
    found = [
        stage.step(context, at(place), Motion(metres, 0.0, 0.0) if number else None, state).limit
        for number, place in enumerate(places)
    ]
    return found, context


def told(limit: ViewLimit | None) -> Any:
    return None if limit is None else (round(limit.distance, 6), limit.settled)


def test_the_limit_is_a_share_of_the_median_of_all_pairs_so_far() -> None:
    found, context = limits(FirstViewsLimit(share=0.5, views=4), [0.0, 4.0, 6.0, 12.0, 100.0])
    # pairs: 4 | 6, 2 | 12, 8, 6: medians 4, 4, 6
    assert [told(limit) for limit in found] == [None, (2.0, False), (2.0, False), (3.0, True), (3.0, True)]
    assert context.facts["view_limit"] == 3.0


def test_views_of_a_robot_that_stands_still_do_not_count() -> None:
    found, _ = limits(FirstViewsLimit(share=1.0), [0.0, 1.0, 2.0, 3.0], metres=0.004)
    assert [told(limit) for limit in found] == [None, None, None, (3.0, False)]  # 12 mm from the first


def test_what_was_measured_is_let_go_of_once_it_is_settled() -> None:
    stage, context, state = FirstViewsLimit(views=3), Context("limit"), FirstViews()
    for place in (0.0, 1.0, 2.0, 3.0):
        stage.step(context, at(place), Motion(1.0, 0.0, 0.0), state)
    assert state.settled
    assert not len(state.views)
    assert not len(state.distances)
    assert state.limit == pytest.approx(0.65)


def test_a_fixed_limit_is_given_at_once() -> None:
    assert told(FixedLimit(distance=7.0).step(Context("limit")).limit) == (7.0, True)
