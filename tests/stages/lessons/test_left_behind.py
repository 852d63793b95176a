import numpy as np

from omninav.pipeline import Context, Tick
from omninav.stages.lessons.left_behind import Behind, LeftBehind
from omninav.stages.values.belief import GaussianMixture
from omninav.stages.values.pose import UncertainMotion
from omninav.stages.values.views import Coefficients

STATE = GaussianMixture(np.zeros((1, 3)), np.eye(3)[None], np.ones(1))
VIEW = Coefficients(np.zeros(2, np.float32), np.zeros((1, 2), np.float32))


def due(stage: LeftBehind, behind: Behind, index: int, metres: float | None, first: bool = False) -> list[int]:
    ctx = Context("lessons")
    ctx.tick = Tick(index, index, 0, index, first)
    model = None if metres is None else UncertainMotion((0.0, metres, 0.0), (0.1, 0.1, 0.1))
    return [lesson.index for lesson in stage.step(ctx, VIEW, STATE, model, behind).lessons.items]


def test_a_view_is_learned_once_the_robot_has_driven_on() -> None:
    stage, behind = LeftBehind(metres=1.0), Behind()
    assert [due(stage, behind, n, 0.25 if n else None) for n in range(7)] == [[], [], [], [], [0], [1], [2]]


def test_backwards_is_driving_on_too_and_turning_is_not() -> None:
    stage, behind = LeftBehind(metres=1.0), Behind()
    assert [due(stage, behind, n, way) for n, way in enumerate((None, 0.0, 0.0, -1.0))] == [[], [], [], [0, 1, 2]]


def test_what_waits_is_learned_as_the_next_log_begins() -> None:
    stage, behind = LeftBehind(metres=9.0), Behind()
    for n in range(3):
        due(stage, behind, n, 1.0 if n else None)
    assert due(stage, behind, 3, None, first=True) == [0, 1, 2]
    assert [lesson.index for lesson in behind.lessons] == [3]


def test_a_robot_that_stands_for_ever_keeps_no_more_than_the_longest_queue() -> None:
    stage, behind = LeftBehind(metres=1.0, longest=10), Behind()
    for n in range(50):
        due(stage, behind, n, 0.0)
    assert len(behind.lessons) == 10


def test_without_any_metres_each_view_is_learned_at_once() -> None:
    stage, behind = LeftBehind(metres=0.0), Behind()
    assert [due(stage, behind, n, 0.0) for n in range(3)] == [[0], [1], [2]]


def test_a_state_that_says_nothing_teaches_nothing() -> None:
    none = GaussianMixture(np.empty((0, 3)), np.empty((0, 3, 3)), np.empty(0))
    behind = Behind()
    LeftBehind(metres=0.0).step(Context("lessons"), VIEW, none, None, behind)
    assert not behind.lessons
