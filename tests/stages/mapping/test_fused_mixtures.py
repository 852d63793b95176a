import numpy as np
import pytest

from omninav.pipeline import Context
from omninav.stages.mapping.fused_mixtures import FusedMixtures, Unjudged
from omninav.stages.values.belief import GaussianMixture
from omninav.stages.values.lesson import Lesson, Lessons
from omninav.stages.values.view_mixtures import ViewEvent, ViewMixtures
from omninav.stages.values.views import Coefficients, ViewLimit

SIGMA = 0.1


def view(value: float, headings: int = 1) -> Coefficients:
    # With 4 headings: four numbers around the robot, rolled by one for a quarter turn.
    if headings == 1:
        turned = np.array([[value, 0.0]], np.float32)
    else:
        turned = np.stack([np.roll(np.array([value, 0, 0, 0], np.float32), -n) for n in range(4)])
    return Coefficients(turned[0], turned)


def state(*places: float, weights: tuple[float, ...] = (1.0,), heading: float = 0.0) -> GaussianMixture:
    means = np.array([[x, 0.0, heading] for x in places])
    return GaussianMixture(means, np.repeat(np.eye(3)[None] * SIGMA**2, len(places), axis=0), np.array(weights))


def learn(
    map: ViewMixtures,
    view: Coefficients,
    state: GaussianMixture,
    stage: FusedMixtures | None = None,
    limit: float = 1.0,
) -> ViewEvent:
    stage = FusedMixtures(spread=False) if stage is None else stage
    out = stage.step(Context("mapping"), Lessons((Lesson(view, state, 0),)), ViewLimit(limit), map, Unjudged())
    assert out.events is not None
    return out.events


def test_a_view_that_resembles_none_becomes_a_map_point_with_the_state_it_was_seen_in() -> None:
    map = ViewMixtures.empty()
    event = learn(map, view(0.0), state(1.0, 5.0, weights=(0.7, 0.3)))
    assert event.inserted.tolist() == [0]
    assert learn(map, view(3.0), state(2.0)).inserted.tolist() == [1]
    assert len(map) == 2
    assert map.means[map.owner == 0][:, 0].tolist() == [1.0, 5.0]
    assert map.weights[map.owner == 0].tolist() == [0.7, 0.3]


def test_a_known_view_seen_at_the_same_place_is_averaged() -> None:
    map = ViewMixtures.empty()
    learn(map, view(0.0), state(0.0))
    event = learn(map, view(0.5), state(0.2))
    assert not len(event.inserted)
    assert event.changed.tolist() == [0]
    assert map.means[:, 0] == pytest.approx([0.1])
    assert map.weights == pytest.approx([1.0])
    assert map.counts == pytest.approx([2.0])
    assert map.covariances[0, 0, 0] == pytest.approx(SIGMA**2)


def test_with_the_spread_of_the_means_a_merged_place_is_as_wide_as_what_it_holds() -> None:
    map, stage = ViewMixtures.empty(), FusedMixtures(spread=True)
    learn(map, view(0.0), state(0.0), stage)
    learn(map, view(0.0), state(0.2), stage)
    assert map.covariances[0, 0, 0] == pytest.approx(SIGMA**2 + 0.1**2)


def test_a_wrong_place_loses_half_of_its_weight_each_time_and_is_gone_below_a_hundredth() -> None:
    # The paper's example: (y, x1) with weight 1 becomes (x1 0.5, x2 0.5); x1 goes on to 1/128 and is removed.
    map = ViewMixtures.empty()
    learn(map, view(0.0), state(9.0))
    lived = []
    for _ in range(8):
        learn(map, view(0.0), state(0.0))
        wrong = map.weights[map.means[:, 0] > 5.0]
        lived.append(float(wrong.sum()))
        assert map.weights.sum() == pytest.approx(1.0)
    assert lived[:6] == pytest.approx([0.5**n for n in range(1, 7)])
    assert lived[6] == 0.0
    assert len(map.weights) == 1


def test_all_views_within_the_limit_take_the_state_in_and_no_other() -> None:
    map = ViewMixtures.empty()
    for value in (0.0, 1.5, 4.0):
        learn(map, view(value), state(value))
    event = learn(map, view(0.75), state(9.0))
    assert event.changed.tolist() == [0, 1]
    assert np.bincount(map.owner).tolist() == [2, 2, 1]


def test_headings_are_kept_as_those_of_a_robot_that_sees_the_view_unturned() -> None:
    map = ViewMixtures.empty()
    first = view(9.0, headings=4)
    learn(map, first, state(0.0, heading=0.3))
    turned = Coefficients(
        first.turned[1].copy(), np.roll(first.turned, -1, axis=0)
    )  # the robot stands turned by 90 degrees
    learn(map, turned, state(0.0, heading=0.3 + np.pi / 2))
    assert map.means[:, 2] == pytest.approx([0.3])


def test_before_there_is_a_limit_only_the_first_view_is_kept_and_the_others_wait() -> None:
    map, stage, unjudged = ViewMixtures.empty(), FusedMixtures(), Unjudged()
    for value in (0.0, 9.0):
        stage.step(Context("mapping"), Lessons((Lesson(view(value), state(0.0), 0),)), None, map, unjudged)
    assert len(map) == 1
    stage.step(Context("mapping"), None, ViewLimit(1.0), map, unjudged)
    assert map.views[:, 0].tolist() == [0.0, 9.0]
    assert not unjudged.lessons


def test_nothing_to_learn_changes_nothing() -> None:
    map = ViewMixtures.empty()
    assert FusedMixtures().step(Context("mapping"), Lessons(()), None, map, Unjudged()).events is None
    assert FusedMixtures().step(Context("mapping"), None, None, map, Unjudged()).map is map


def test_a_map_never_holds_more_views_than_it_may() -> None:
    map, stage = ViewMixtures.empty(), FusedMixtures(max_views=3)
    events = [learn(map, view(3.0 * n), state(float(n)), stage) for n in range(6)]
    assert len(map) == 3
    assert events[-1].why == "full"
    assert len(events[-1].removed) == 1
    assert map.names.tolist()[-1] == 5
