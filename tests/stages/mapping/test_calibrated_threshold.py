"""The limit between views that is measured on a drive's first ones, on made views whose distances are known."""

import numpy as np
import pytest
from made_view_maps import view

from omninav.pipeline import Context
from omninav.stages.mapping.calibrated_threshold import (
    CalibratedThreshold,
    CalibratedThresholdState,
    distance_to_new_view,
)
from omninav.stages.values.pose import Motion
from omninav.stages.values.view_mixtures import ViewMixtures
from omninav.stages.values.views import NoveltyThreshold


def limits(
    stage: CalibratedThreshold, places: list[float], metres: float = 0.1, first: CalibratedThresholdState | None = None
) -> tuple[list[NoveltyThreshold | None], Context]:
    ctx, state = Context("limit"), first or CalibratedThresholdState()
    return [stage.step(ctx, view(place), Motion(metres, 0.0, 0.0), state).threshold for place in places], ctx


def told(limit: NoveltyThreshold | None) -> tuple[float, bool] | None:
    return None if limit is None else (round(limit.distance, 6), limit.settled)


def test_the_limit_is_a_share_of_the_median_distance_of_views_far_enough_apart() -> None:
    found, ctx = limits(CalibratedThreshold(views=5, min_separation=2), [0, 1, 3, 7, 8, 100, 200])
    # Pairs two or more apart: 3; 7, 6; 8, 7, 5: medians 3, 6, 6.5.
    settled = (3.25, True)
    assert [told(limit) for limit in found] == [None, None, (1.5, False), (3.0, False), settled, settled, settled]
    assert ctx.facts["novelty_threshold"] == 3.25


@pytest.mark.parametrize("views", [5, 100], ids=["settled", "being measured"])
def test_a_limit_says_how_far_a_robot_drives_until_it_is_reached(views: int) -> None:
    limit = limits(CalibratedThreshold(views=views, min_separation=2), [0, 1, 3, 7, 8])[0][-1]
    assert limit is not None
    # From 0 the first view at 3.25 or more is 7, three steps of 0.1 m on; from 1 and from 3 it is 7 too: 0.3, 0.2, 0.1.
    assert limit.metres == pytest.approx(0.2)


def test_views_of_a_robot_that_stands_do_not_count() -> None:
    assert limits(CalibratedThreshold(views=5, min_separation=2), [0, 1, 3, 7], metres=0.0)[0] == [None] * 4
    found, _ = limits(CalibratedThreshold(min_separation=1, share=1.0), [0.0, 1.0, 2.0, 3.0], metres=0.004)
    assert [told(limit) for limit in found] == [None, None, None, (3.0, False)]  # 12 mm from the first


def test_what_was_measured_is_let_go_of_once_it_is_settled() -> None:
    first = CalibratedThresholdState()
    limits(CalibratedThreshold(views=3, min_separation=1), [0.0, 1.0, 2.0, 3.0], first=first)
    assert told(first.threshold) == (0.5, True)
    assert not len(first.views)
    assert not first.table
    assert not first.gaps_m


def test_there_must_be_a_pair_that_far_apart() -> None:
    with pytest.raises(ValueError, match="min_separation: of 20 views none"):
        CalibratedThreshold(views=20, min_separation=20)


def test_a_view_counts_after_as_much_driving_as_asked_in_any_direction(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("omninav.stages.mapping.calibrated_threshold.MIN_MOVE_M", 0.05)
    ctx, state, stage = Context("limit"), CalibratedThresholdState(), CalibratedThreshold(min_separation=1)
    steps = [None, Motion(0.03, 0.0, 1.0), Motion(0.0, 0.04, 0.0), None, Motion(0.03, -0.04, 0.0)]
    counted = []
    for place, motion in enumerate(steps):
        stage.step(ctx, view(place), motion, state)
        counted.append(len(state.views))
    assert counted == [1, 1, 2, 2, 3]
    assert state.gaps_m == pytest.approx([0.0, 0.07, 0.05])
    assert state.since_m == 0.0


def test_a_drive_that_never_gets_beyond_its_threshold_does_not_say_how_far_it_reaches() -> None:
    # Pairs 0 to 4 and 4 to 0 of three: threshold 2 x 4 = 8, and no view is 8 from another.
    limit = limits(CalibratedThreshold(views=3, min_separation=1, share=2.0), [0.0, 4.0, 0.0])[0][-1]
    assert limit is not None
    assert (limit.distance, limit.metres, limit.settled) == (8.0, 0.0, True)


def test_a_view_as_far_as_the_threshold_is_beyond_it() -> None:
    assert distance_to_new_view(4.0, [np.zeros(0), np.array([4.0]), np.array([3.0, 5.0])], [0.0, 0.5, 0.25]) == 0.375
    assert distance_to_new_view(9.0, [np.zeros(0), np.array([4.0])], [0.0, 0.5]) == 0.0


def test_a_known_threshold_is_taken_as_it_is_and_nothing_measured() -> None:
    known, ctx, state = ViewMixtures.empty(), Context("limit"), CalibratedThresholdState()
    known.keep_threshold(NoveltyThreshold(7.12344, True, 0.3))
    found = [CalibratedThreshold().step(ctx, view(n), None, state, known).threshold for n in range(3)]
    assert found == [known.threshold] * 3
    assert ctx.facts["novelty_threshold"] == 7.1234
    assert not len(state.views)


def test_the_manifest_has_the_threshold_to_four_decimals() -> None:
    assert limits(CalibratedThreshold(min_separation=1), [0.0, 1.23456])[1].facts["novelty_threshold"] == 0.6173
