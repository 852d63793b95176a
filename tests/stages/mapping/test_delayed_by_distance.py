from typing import Any

import numpy as np
import pytest

from omninav.pipeline import Context, Tick
from omninav.stages.geometry.plane.odometry_motion import move_gaussians
from omninav.stages.mapping.delayed_by_distance import DelayedByDistance, DelayedByDistanceState
from omninav.stages.values.belief import GaussianMixture
from omninav.stages.values.map_update import MapUpdates
from omninav.stages.values.pose import UncertainMotion
from omninav.stages.values.view_mixtures import ViewMixtures
from omninav.stages.values.views import Coefficients, Neighbours

STATE = GaussianMixture(np.zeros((1, 3)), np.eye(3)[None], np.ones(1))
VIEW = Coefficients(np.zeros(2, np.float32), np.zeros((1, 2), np.float32))


def due(
    stage: DelayedByDistance, behind: DelayedByDistanceState, index: int, metres: float | None, first: bool = False
) -> list[int]:
    ctx = Context("lessons")
    ctx.tick = Tick(index, index, 0, index, first)
    model = None if metres is None else UncertainMotion((0.0, metres, 0.0), (0.1, 0.1, 0.1))
    return [lesson.index for lesson in stage.step(ctx, VIEW, STATE, model, behind).updates.items]


def test_a_view_is_learned_once_the_robot_has_driven_on() -> None:
    stage, behind = DelayedByDistance(metres=1.0), DelayedByDistanceState()
    assert [due(stage, behind, n, 0.25 if n else None) for n in range(7)] == [[], [], [], [], [0], [1], [2]]


def test_backwards_is_driving_on_too_and_turning_is_not() -> None:
    stage, behind = DelayedByDistance(metres=1.0), DelayedByDistanceState()
    assert [due(stage, behind, n, way) for n, way in enumerate((None, 0.0, 0.0, -1.0))] == [[], [], [], [0, 1, 2]]


def test_what_waits_is_learned_as_the_next_log_begins() -> None:
    stage, behind = DelayedByDistance(metres=9.0), DelayedByDistanceState()
    for n in range(3):
        due(stage, behind, n, 1.0 if n else None)
    assert due(stage, behind, 3, None, first=True) == [0, 1, 2]
    assert [lesson.index for lesson in behind.lessons] == [3]


def test_a_robot_that_stands_for_ever_keeps_no_more_than_the_longest_queue() -> None:
    stage, behind = DelayedByDistance(metres=1.0, longest=10), DelayedByDistanceState()
    for n in range(50):
        due(stage, behind, n, 0.0)
    assert len(behind.lessons) == 10


def test_without_any_metres_each_view_is_learned_at_once() -> None:
    stage, behind = DelayedByDistance(metres=0.0), DelayedByDistanceState()
    assert [due(stage, behind, n, 0.0) for n in range(3)] == [[0], [1], [2]]


def test_a_state_that_says_nothing_teaches_nothing() -> None:
    none = GaussianMixture(np.empty((0, 3)), np.empty((0, 3, 3)), np.empty(0))
    behind = DelayedByDistanceState()
    DelayedByDistance(metres=0.0).step(Context("lessons"), VIEW, none, None, behind)
    assert not behind.lessons


def around_a_square(end: tuple[float, float, float], **options: Any) -> list[MapUpdates]:
    """What is taught on a square of four metres, five pictures a side, by odometry alone up to the last picture; there
    a view of the map says that the robot is at `end`."""
    stage, behind, ctx = DelayedByDistance(metres=1.0, **options), DelayedByDistanceState(), Context("lessons")
    map = ViewMixtures.empty()
    map.add_view(VIEW.values, "Coefficients")
    none = Neighbours(np.empty(0, np.int64), np.empty(0), np.empty(0), np.empty(0), np.inf)
    seen = Neighbours(np.zeros(1, np.int64), np.zeros(1), np.ones(1), np.zeros(1), 0.0)
    certain = np.diag([0.02, 0.02, 0.02])[None] ** 2
    means, covariances = np.zeros((1, 3)), certain
    out = []
    for n in range(21):
        ctx.tick = Tick(n, n, 0, n, n == 0)
        model = None if n == 0 else UncertainMotion((np.pi / 2 if n % 5 == 1 and n > 1 else 0.0, 0.8, 0.0), (0.05,) * 3)
        if model is not None:
            means, covariances = move_gaussians(means, covariances, model.steps, model.sigmas)
        state = GaussianMixture(means, covariances, np.ones(1))
        if n == 20:
            state = GaussianMixture(np.array([end]), certain, np.ones(1))
        out.append(stage.step(ctx, VIEW, state, model, behind, seen if n == 20 else none, map).updates)
    return out


def test_where_the_way_closes_what_was_taught_on_it_is_given_again_along_odometry() -> None:
    # Odometry leads back to (0, 0), the map says (0.4, 0): the way in between gives way, more where nearer to the end.
    lessons = around_a_square((0.4, 0.0, -np.pi / 2))
    assert all(tick.open_from == 0 for tick in lessons)
    taught = {lesson.index: lesson.state for tick in lessons[:-1] for lesson in tick.items}
    again = {lesson.index: lesson.state for lesson in lessons[-1].items}
    assert set(again) >= set(range(3, 19))
    shift = {n: float(np.hypot(*(again[n].means[0] - taught[n].means[0])[:2])) for n in again if n in taught}
    assert shift[4] < 0.1 < shift[16] < 0.45
    for n, before in taught.items():
        if n in again:
            assert np.linalg.det(again[n].covariances[0]) < np.linalg.det(before.covariances[0])


@pytest.mark.parametrize(
    ("end", "options"),
    [((0.4, 0.0, -np.pi / 2), {"back_propagate": False}), ((9.0, 0.0, -np.pi / 2), {})],
    ids=["where it is switched off", "where odometry cannot have led"],
)
def test_what_was_taught_stays(end: tuple[float, float, float], options: dict[str, bool]) -> None:
    lessons = around_a_square(end, **options)
    indices = [lesson.index for tick in lessons for lesson in tick.items]
    assert indices == sorted(set(indices))
