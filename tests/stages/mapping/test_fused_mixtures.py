import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_beliefs import along_x
from made_view_maps import view

from omninav.pipeline import Context
from omninav.stages.mapping.fused_mixtures import Average, FusedMixtures, FusedMixturesState, fuse, parts
from omninav.stages.values.belief import GaussianMixture
from omninav.stages.values.map_update import MapUpdate, MapUpdates
from omninav.stages.values.view_mixtures import ViewEvent, ViewMixtures
from omninav.stages.values.views import Coefficients, NoveltyThreshold

SIGMA, LIMIT = 0.1, NoveltyThreshold(1.0)
HELD = ("means", "covariances", "weights", "counts")


def facing(heading: float, state: GaussianMixture) -> GaussianMixture:
    state.means[:, 2] = heading
    return state


def learn(
    map: ViewMixtures, view: Coefficients, state: GaussianMixture, stage: FusedMixtures | None = None
) -> ViewEvent:
    stage, updates = stage or FusedMixtures(spread=False), MapUpdates((MapUpdate(view, state, 0),))
    events = stage.step(Context("mapping"), updates, LIMIT, map, FusedMixturesState()).events
    assert events is not None
    return events


def test_a_view_that_resembles_none_becomes_a_map_point_with_the_state_it_was_seen_in() -> None:
    map = ViewMixtures.empty()
    event = learn(map, view(0.0), along_x(1.0, 5.0, weights=(0.7, 0.3)))
    assert event.inserted.tolist() == [0]
    assert learn(map, view(3.0), along_x(2.0)).inserted.tolist() == [1]
    assert len(map) == 2
    assert map.means[map.owner == 0][:, 0].tolist() == [1.0, 5.0]
    assert map.weights[map.owner == 0].tolist() == [0.7, 0.3]


@pytest.mark.parametrize(("average", "place"), [("halves", 0.15), ("visits", 0.1)])
def test_a_known_view_seen_at_the_same_place_is_averaged(average: Average, place: float) -> None:
    # 0, 0.2 at half the likeness (0.5 of the limit 1.0), 0.2 again: of 1 + 0.5 + 0.5 visits half are at 0.2.
    map, stage = ViewMixtures.empty(), FusedMixtures(spread=False, average=average)
    learn(map, view(0.0), along_x(0.0), stage)
    for _ in range(2):
        event = learn(map, view(0.5), along_x(0.2), stage)
        assert not len(event.inserted)
        assert event.changed.tolist() == [0]
    assert map.means[:, 0] == pytest.approx([place])
    assert map.weights == pytest.approx([1.0])
    assert map.counts == pytest.approx([2.0])
    assert map.covariances[0, 0, 0] == pytest.approx(SIGMA**2)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000), st.sampled_from(["visits", "halves"]))
def test_a_lesson_given_again_leaves_the_map_as_if_it_had_been_known_in_the_first_place(
    seed: int, average: Average
) -> None:
    rng = np.random.default_rng(seed)
    views = rng.uniform(0.0, 4.0, 12)
    first, then = rng.uniform(0.0, 2.0, (2, 12))
    again = np.flatnonzero(rng.random(12) < 0.4)
    known = np.where(np.isin(np.arange(12), again), then, first)
    maps = []
    for taught, corrected in ((first, again), (known, [])):
        map, stage, learned = ViewMixtures.empty(), FusedMixtures(average=average), FusedMixturesState()
        for updates in (
            *([MapUpdate(view(views[n]), along_x(taught[n]), n)] for n in range(12)),
            [MapUpdate(view(views[n]), along_x(then[n]), int(n)) for n in corrected],
        ):
            stage.step(Context("mapping"), MapUpdates(tuple(updates), open_from=0), LIMIT, map, learned)
        maps.append(map)
    assert maps[0].ids.tolist() == maps[1].ids.tolist()
    for row in range(len(maps[0])):
        for mine, expected in zip(*([getattr(m, f)[m.owner == row] for f in HELD] for m in maps), strict=True):
            np.testing.assert_array_equal(mine, expected)


def test_a_lesson_from_before_the_open_ones_stays_and_is_learned_once_more() -> None:
    map, stage, learned = ViewMixtures.empty(), FusedMixtures(), FusedMixturesState()
    for index, place, open_from in ((0, 0.0, 0), (1, 9.0, 1), (0, 5.0, 1)):
        step(map, stage, learned, (0.0, place, index), open_from=open_from)
    assert sorted(map.means[:, 0].tolist()) == [0.0, 5.0, 9.0]


def test_what_a_full_map_has_dropped_does_not_come_back_with_a_lesson_given_again() -> None:
    map, stage, learned = ViewMixtures.empty(), FusedMixtures(max_views=2), FusedMixturesState()
    why = []
    for index, place in ((0, 0.0), (1, 3.0), (2, 6.0), (1, 4.0)):
        event, _ = step(map, stage, learned, (3.0 * index, place, index), open_from=0)
        why.append(event and event.why)
    assert why == ["", "", "full", ""]
    assert map.views[:, 0].tolist() == [3.0, 6.0]
    assert sorted(map.means[:, 0].tolist()) == [4.0, 6.0]


def test_a_wrong_place_loses_half_of_its_weight_each_time_and_is_gone_below_a_hundredth() -> None:
    # The paper's example: (y, x1) with weight 1 becomes (x1 0.5, x2 0.5); x1 goes on to 1/128 and is removed.
    map = ViewMixtures.empty()
    learn(map, view(0.0), along_x(9.0))
    lived = []
    for _ in range(8):
        learn(map, view(0.0), along_x(0.0))
        wrong = map.weights[map.means[:, 0] > 5.0]
        lived.append(float(wrong.sum()))
        assert map.weights.sum() == pytest.approx(1.0)
    assert lived[:6] == pytest.approx([0.5**n for n in range(1, 7)])
    assert lived[6] == 0.0
    assert len(map.weights) == 1


def test_all_views_within_the_limit_take_the_state_in_and_no_other() -> None:
    map = ViewMixtures.empty()
    for value in (0.0, 1.5, 4.0):
        learn(map, view(value), along_x(value))
    event = learn(map, view(0.75), along_x(9.0))
    assert event.changed.tolist() == [0, 1]
    assert np.bincount(map.owner).tolist() == [2, 2, 1]


def test_headings_are_kept_as_those_of_a_robot_that_sees_the_view_unturned() -> None:
    # Four numbers around the robot, rolled by one for a quarter turn.
    map, ring = ViewMixtures.empty(), np.array([9.0, 0.0, 0.0, 0.0], np.float32)
    rolled = np.stack([np.roll(ring, -n) for n in range(4)])
    learn(map, Coefficients(rolled[0], rolled), facing(0.3, along_x(0.0)))
    turned = Coefficients(rolled[1].copy(), np.roll(rolled, -1, axis=0))  # the robot stands turned by 90°
    learn(map, turned, facing(0.3 + np.pi / 2, along_x(0.0)))
    assert map.means[:, 2] == pytest.approx([0.3])


@pytest.mark.parametrize("average", ["visits", "halves"])
def test_of_parts_that_are_all_weak_the_heaviest_stays(average: Average) -> None:
    map, stage = ViewMixtures.empty(), FusedMixtures(average=average)
    places = tuple(float(n) for n in range(0, 480, 4))
    weights = np.full(120, 1.0)
    weights[70] = 1.1
    learn(map, view(0.0), along_x(*places, weights=tuple(weights / weights.sum())), stage)
    assert map.means[:, 0].tolist() == [280.0]
    assert map.weights.tolist() == [1.0]
    learn(map, view(9.0), along_x(*places, weights=(1 / 120,) * 120), stage)
    assert map.weights[map.owner == 1].sum() == pytest.approx(1.0), "of equals none is better than the others"


def test_a_state_is_kept_as_seen_from_the_view_s_own_heading() -> None:
    means, covariances, weights, counts = parts(facing(3.0, along_x(1.0, 2.0, weights=(0.75, 0.25))), -0.5, 0.4)
    assert means.tolist() == [[1.0, 0.0, pytest.approx(3.5 - 2 * np.pi)], [2.0, 0.0, pytest.approx(3.5 - 2 * np.pi)]]
    assert covariances[1] == pytest.approx(np.eye(3) * SIGMA**2)
    assert weights.tolist() == [0.75, 0.25]
    assert counts == pytest.approx([0.3, 0.1])


def test_mixtures_side_by_side_are_merged_normalised_and_freed_of_what_is_light() -> None:
    # 0 and 0.2 merge (squared distance 2), 9 stays; of the sum 2: 0.98, 0.01 and 0.01. What weighs a hundredth stays.
    one, other = along_x(0.0, 9.0, weights=(0.98, 0.02)), along_x(0.2, 20.0, weights=(0.98, 0.02))
    both = [parts(one, 0.0, 1.0), parts(other, 0.0, 0.5)]
    for average, place in (("halves", 0.1), ("visits", 0.2 / 3)):
        means, covariances, weights, counts = fuse(both, 2.5, True, 0.01, average)  # type: ignore[arg-type]
        assert means[:, 0] == pytest.approx([place, 9.0, 20.0])
        assert weights == pytest.approx([0.98, 0.01, 0.01])
        assert counts == pytest.approx([0.98 * 1.5, 0.02, 0.01])
        apart = SIGMA**2 + place * (0.2 - place)
        assert covariances[0, 0, 0] == pytest.approx(apart)
        means, _, weights, counts = fuse(both, 1.5, True, 0.0101, average)  # type: ignore[arg-type]
        assert means[:, 0] == pytest.approx([0.0, 0.2])
        assert weights.tolist() == [0.5, 0.5]
        assert counts == pytest.approx([0.98, 0.49])


def step(
    map: ViewMixtures,
    stage: FusedMixtures,
    pending: FusedMixturesState,
    *updates: tuple[float, float, int],
    limit: NoveltyThreshold | None = LIMIT,
    **said: int | bool,
) -> tuple[ViewEvent | None, Context]:
    """Learn views (look, place, tick)."""
    ctx = Context("mapping")
    items = tuple(MapUpdate(view(look), along_x(place), tick) for look, place, tick in updates)
    return stage.step(ctx, MapUpdates(items, **said), limit, map, pending).events, ctx  # type: ignore[arg-type]


def test_a_correction_of_what_still_waits_for_a_threshold_takes_its_place() -> None:
    map, stage, pending = ViewMixtures.empty(), FusedMixtures(), FusedMixturesState()
    step(map, stage, pending, (0.0, 0.0, 0), limit=None, open_from=0)
    step(map, stage, pending, (3.0, 3.0, 1), (6.0, 6.0, 2), limit=None, open_from=0)
    step(map, stage, pending, (3.0, 4.0, 1), limit=None, open_from=0)
    assert [update.index for update in pending.waiting] == [1, 2]
    event, ctx = step(map, stage, pending, open_from=0)
    assert map.means[:, 0].tolist() == [0.0, 4.0, 6.0]
    assert event is not None
    assert (event.inserted.tolist(), event.seen.tolist()) == ([1, 2], [1, 2])
    assert not ctx.counts


def test_what_is_learned_again_is_counted_and_named() -> None:
    map, stage, pending = ViewMixtures.empty(), FusedMixtures(), FusedMixturesState()
    step(map, stage, pending, (0.0, 0.0, 4), (3.0, 3.0, 5), (6.0, 6.0, 6), open_from=4)
    event, ctx = step(map, stage, pending, (3.0, 4.0, 5), (9.0, 9.0, 7), open_from=5)
    assert ctx.counts == {"update_undone": 1}
    assert event is not None
    assert event.changed.tolist() == [1, 2, 3]
    assert (event.inserted.tolist(), event.seen.tolist(), event.removed.tolist()) == ([3], [7], [])
    assert [applied.index for applied in pending.open] == [5, 6, 7]
    assert map.steps == 4
    assert sorted(map.means[:, 0].tolist()) == [0.0, 4.0, 6.0, 9.0]


def test_updates_without_a_beginning_of_what_may_change_are_learned_once_more() -> None:
    map, stage, pending = ViewMixtures.empty(), FusedMixtures(), FusedMixturesState()
    step(map, stage, pending, (0.0, 0.0, 4), open_from=4)
    step(map, stage, pending, (0.0, 9.0, 4))
    assert map.means[:, 0].tolist() == [0.0, 9.0]
    assert pending.open == []


def test_a_map_that_is_learned_again_forgets_all_before() -> None:
    map, stage, pending = ViewMixtures.empty(), FusedMixtures(), FusedMixturesState()
    step(map, stage, pending, (0.0, 0.0, 4), (3.0, 3.0, 5), open_from=4)
    event, _ = step(map, stage, pending, (0.0, 7.0, 4), open_from=4, relearn=True)
    assert map.means[:, 0].tolist() == [7.0]
    assert map.ids.tolist() == [2]
    assert event is not None
    assert (event.inserted.tolist(), event.removed.tolist(), event.why) == ([2], [0, 1], "")
    assert [applied.index for applied in pending.open] == [4]


def test_a_full_map_names_what_it_drops_and_keeps_what_can_be_undone_of_the_rest() -> None:
    map, stage, pending = ViewMixtures.empty(), FusedMixtures(max_views=2), FusedMixturesState()
    event, _ = step(map, stage, pending, (0.0, 0.0, 0), (3.0, 3.0, 1), (3.5, 3.0, 2), (6.0, 6.0, 3), open_from=0)
    assert event is not None
    assert (event.inserted.tolist(), event.removed.tolist(), event.changed.tolist()) == ([1, 2], [], [1, 2])
    assert map.ids.tolist() == [1, 2]
    assert [applied.ids.tolist() for applied in pending.open] == [[], [1], [1], [2]]
    step(map, stage, pending, (3.0, 5.0, 1), open_from=0)
    assert sorted(map.means[:, 0].round(3).tolist()) == [3.0, 5.0, 6.0]
    assert map.counts[map.means[:, 0] == 3.0] == pytest.approx([0.5])
