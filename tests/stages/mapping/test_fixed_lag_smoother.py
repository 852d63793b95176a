"""Past states corrected along the odometry."""

from typing import Any

import numpy as np
import pytest
from made_beliefs import along_x
from made_view_maps import learned, view

from omninav.pipeline import Context, Tick
from omninav.stages.mapping.fixed_lag_smoother import FixedLagSmoother, FixedLagSmootherState
from omninav.stages.values.belief import GaussianMixture
from omninav.stages.values.map_update import MapUpdates
from omninav.stages.values.pose import UncertainMotion
from omninav.stages.values.view_mixtures import ViewMixtures
from omninav.stages.values.views import Neighbours

VIEW = view(0.0)


SPLIT, UNKNOWN = along_x(0.0, 50.0, sigma=0.02), along_x()
BORN = (1, 1, 2, 7, 8, 9)
"""The steps at which the views of a map were inserted, a view each."""


def at(x: float, y: float = 0.0, sigma: float = 0.02) -> GaussianMixture:
    return GaussianMixture(np.array([[x, y, 0.0]]), np.diag([sigma, sigma, 0.02])[None] ** 2, np.ones(1))


class Straight:
    """Drives ahead, a metre from image to image by odometry; says what is believed, and by which views of the map."""

    def __init__(self, **options: Any) -> None:
        self.stage, self.path = FixedLagSmoother(**options), FixedLagSmootherState()
        self.ctx, self.map = Context("fixed_lag_smoother"), ViewMixtures.empty()
        for born in BORN:
            self.map.put(steps=born)
            learned(0.0, map=self.map)
        self.tick = 0

    def to(self, state: GaussianMixture, by: tuple[int, ...] = (), moved: bool = True) -> MapUpdates:
        rows = np.array(by, np.int64)
        some = np.zeros(len(rows))
        seen = Neighbours(rows, some, some, some, 0.0)
        model = UncertainMotion((0.0, 1.0, 0.0), (0.01, 0.01, 0.01)) if moved and self.tick else None
        self.ctx.tick = Tick(self.tick, self.tick, 0, self.tick, not self.tick)
        self.tick += 1
        return self.stage.step(self.ctx, VIEW, state, model, self.path, seen, self.map).corrections

    def led_away(
        self, *between: GaussianMixture, end: GaussianMixture | None = None, by: tuple[int, ...] = (2,)
    ) -> dict:
        """Right up to 2 m, away in between by a view of step 7, and right again by what view is said."""
        for x in range(3):
            assert not self.to(at(x), (0,)).items
        for state in between:
            assert not self.to(state, (3,)).items
        corrected = self.to(at(3.0 + len(between)) if end is None else end, by).items
        assert all(update.reconstructed for update in corrected)
        return {update.index: update.state.means[0].round(2).tolist() for update in corrected}


ALONG = {3: [3.0, 0.0, 0.0], 4: [4.0, 0.0, 0.0]}


def test_where_the_belief_returns_to_where_odometry_led_the_states_in_between_are_those_of_the_path() -> None:
    drive = Straight(back_propagate=False)
    assert drive.led_away(at(3.0, 5.0), at(4.0, 5.0)) == ALONG
    assert drive.ctx.counts == {"belief_jumped": 2, "view_reconstructed": 2}
    assert drive.path.jumps == []
    assert [update.state.means[0, 1].round(3) for update in drive.path.past] == [0.0] * 6


@pytest.mark.parametrize("by", [(3,), (4,), (3, 5)])
def test_what_leads_back_must_be_older_than_what_led_away(by: tuple[int, ...]) -> None:
    drive = Straight(back_propagate=False)
    assert drive.led_away(at(3.0, 5.0), at(4.0, 5.0), by=by) == {}
    assert drive.path.jumps == [(2, 7), (4, min(BORN[row] for row in by))]


def test_the_oldest_view_that_supports_the_new_place_counts() -> None:
    assert Straight(back_propagate=False).led_away(at(3.0, 5.0), at(4.0, 5.0), by=(5, 2)) == ALONG


def test_a_robot_that_was_carried_away_is_not_brought_back() -> None:
    # Ahead its variance is that of both ends and of three metres, 2 x 0.02^2 + 3 x 0.01^2: 16.3 of it are 0.1339^2.
    for x, back in ((5.133, {3, 4}), (5.135, set())):
        drive = Straight(back_propagate=False)
        assert set(drive.led_away(at(3.0, 5.0), at(4.0, 5.0), end=at(x))) == back
    assert Straight(reconstruct_path=False, back_propagate=False).led_away(at(3.0, 5.0), at(4.0, 5.0)) == {}


def test_states_in_between_that_agree_with_the_path_stay_and_unknown_ones_are_no_updates() -> None:
    drive = Straight(back_propagate=False)
    assert drive.led_away(at(3.0, 5.0), SPLIT, UNKNOWN, at(6.0, 5.0), at(7.0, 5.0)) == {
        n: [float(n), 0.0, 0.0] for n in (3, 4, 6, 7)
    }
    assert drive.ctx.counts["view_reconstructed"] == 5
    assert drive.path.past[5].state.means[0] == pytest.approx([5.0, 0.0, 0.0], abs=1e-3)
    drive = Straight(back_propagate=False)
    corrected = drive.led_away(at(3.0, 5.0), at(4.0, 3.9, 1.2), at(5.0, 5.0))
    assert set(corrected) == {3, 5}  # 3.9 m of 1.2 m may be the path
    assert drive.ctx.counts == {"belief_jumped": 2, "view_reconstructed": 2}


def test_of_several_jumps_the_last_that_odometry_explains_is_undone_with_all_after_it() -> None:
    drive = Straight(back_propagate=False)
    for x in range(3):
        drive.to(at(x), (0,))
    for x, y, by in ((3, 5.0, 4), (4, 9.0, 3), (5, 9.0, 3)):
        drive.to(at(x, y), (by,))
    assert drive.path.jumps == [(2, 8), (3, 7)]
    assert {update.index for update in drive.to(at(6.0, 0.0), (2,)).items} == {3, 4, 5}
    assert drive.path.jumps == []


def test_without_a_view_of_the_map_or_a_certain_state_nothing_is_corrected() -> None:
    drive = Straight()
    for state, by in ((SPLIT, (0,)), (UNKNOWN, (0,)), (at(50.0), ()), (SPLIT, (0,)), (at(90.0), ())):
        assert not drive.to(state, by).items
    assert not drive.ctx.counts
    assert Straight(back_propagate=False).to(at(0.0)).open_from is None
    lone = Straight()
    assert not lone.to(at(0.0), (0,)).items
    assert not lone.to(SPLIT, (0,)).items


def test_a_path_begins_anew_without_odometry_and_holds_so_many_views() -> None:
    drive = Straight(max_views=3)
    assert [drive.to(at(x)).open_from for x in range(6)] == [0, 0, 0, 0, 1, 2]
    assert (len(drive.path.past), len(drive.path.motions)) == (4, 3)
    assert drive.to(at(6.0), moved=False).open_from == 6
    assert (len(drive.path.past), len(drive.path.motions), drive.path.jumps) == (1, 0, [])
    alone = Straight(max_views=0)
    assert [alone.to(at(x)).open_from for x in range(3)] == [0, 1, 2]
    assert (len(alone.path.past), len(alone.path.motions)) == (1, 0)
    jumping = Straight(max_views=2)
    for x, y, by in ((0, 0.0, 0), (1, 5.0, 3), (2, 5.0, 3), (3, 5.0, 3)):
        jumping.to(at(x, y), (by,))
    assert jumping.path.jumps == []  # what lay before it is forgotten


def grown(
    improvement: float = 2.0, first: float = 0.02, end: float = 4.0, **options: bool
) -> dict[int, GaussianMixture]:
    """Less certain from image to image (0.02, 0.1, 0.2, 0.3 m, or `first` at the beginning), then a view at `end`."""
    drive = Straight(**options)
    for x, sigma in enumerate((first, 0.1, 0.2, 0.3)):
        assert not drive.to(at(x, 0.0, sigma)).items
    with pytest.MonkeyPatch.context() as patch:
        if improvement is not None:
            patch.setattr("omninav.stages.mapping.fixed_lag_smoother.MIN_IMPROVEMENT", improvement)
        return {update.index: update.state for update in drive.to(at(end), (0,)).items}


def test_states_since_the_last_one_that_was_as_certain_become_so() -> None:
    after = grown()
    assert list(after) == [1, 2, 3]
    for n, state in after.items():
        assert state.means[0] == pytest.approx([n, 0.0, 0.0], abs=1e-6)
        assert np.sqrt(state.covariances[0, 0, 0]) < 0.03
    assert grown(end=9.0) == {}  # odometry does not explain the end
    assert grown(back_propagate=False) == {}


def test_how_much_more_certain_a_state_must_become_is_the_root_of_the_determinants_ratio() -> None:
    # (0.1 / 0.02)^2 = 25 from the second image on; (0.3 / 0.02)^2 = 225, that of the last.
    assert list(grown(24.9)) == [1, 2, 3]
    assert list(grown(25.1)) == [2, 3]
    assert list(grown(99.0)) == [2, 3]
    assert grown(226.0) == {}


def test_where_nothing_before_was_as_certain_nothing_is_propagated() -> None:
    # (0.0282 / 0.02)^4 is 3.95 and (0.0284 / 0.02)^4 is 4.07: with twice the root of the determinant it is as certain.
    assert list(grown(first=0.0282)) == [1, 2, 3]
    assert grown(first=0.0284) == {}


def test_a_jump_is_from_the_last_certain_state_be_it_the_first() -> None:
    drive = Straight()
    for state, by in ((at(0.0), 0), (SPLIT, 3), (at(2.0, 5.0), 3)):
        drive.to(state, (by,))
    assert drive.ctx.counts == {"belief_jumped": 1}
    assert drive.path.jumps == [(0, 7)]
