import pytest
from made_beliefs import along_x
from made_ticks import at_tick
from made_view_maps import view

from omninav.pipeline import Context
from omninav.stages.mapping.delayed_by_distance import DelayedByDistance, DelayedByDistanceState
from omninav.stages.values.map_update import MapUpdate, MapUpdates
from omninav.stages.values.pose import UncertainMotion

VIEW, STATE = view(0.0), along_x(0.0)


def due(
    stage: DelayedByDistance, queue: DelayedByDistanceState, index: int, driven_m: float | None, first: bool = False
) -> list[int]:
    model = None if driven_m is None else UncertainMotion((0.0, driven_m, 0.0), (0.1, 0.1, 0.1))
    return [update.index for update in stage.step(at_tick(index, first), VIEW, STATE, model, queue).updates.items]


def test_backwards_is_driving_on_too_and_turning_is_not() -> None:
    stage, queue = DelayedByDistance(distance_m=1.0), DelayedByDistanceState()
    assert [due(stage, queue, n, way) for n, way in enumerate((None, 0.0, 0.0, -1.0))] == [[], [], [], [0, 1, 2]]


def test_waiting_updates_are_given_as_the_next_log_begins() -> None:
    stage, queue = DelayedByDistance(distance_m=9.0), DelayedByDistanceState()
    for n in range(3):
        due(stage, queue, n, 1.0 if n else None)
    assert due(stage, queue, 3, None, first=True) == [0, 1, 2]
    assert [update.index for update in queue.waiting] == [3]


def test_without_a_distance_each_view_is_learned_at_once() -> None:
    stage, queue = DelayedByDistance(distance_m=0.0), DelayedByDistanceState()
    assert [due(stage, queue, n, 0.0) for n in range(3)] == [[0], [1], [2]]


def test_a_state_without_components_gives_no_update() -> None:
    queue = DelayedByDistanceState()
    DelayedByDistance(distance_m=0.0).step(Context("map_update"), VIEW, along_x(), None, queue)
    assert not queue.waiting


def test_corrections_replace_waiting_updates_and_repeat_earlier_ones() -> None:
    stage, queue = DelayedByDistance(distance_m=1.0), DelayedByDistanceState()
    for n in range(6):
        due(stage, queue, n, 0.25 if n else None)
    corrections = MapUpdates(tuple(MapUpdate(VIEW, along_x(1.0), n, reconstructed=True) for n in (1, 4)), 1)
    model = UncertainMotion((0.0, 0.25, 0.0), (0.1, 0.1, 0.1))
    out = stage.step(at_tick(6), VIEW, STATE, model, queue, corrections)
    assert [update.index for update in out.updates.items] == [1, 2]
    assert out.updates.items[0].reconstructed
    assert out.updates.open_from == 1
    assert [update.reconstructed for update in out.waiting.items] == [False, True, False, False]


def test_the_oldest_of_too_many_are_given_in_order(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("omninav.stages.mapping.delayed_by_distance.MAX_WAITING", 2)
    stage, queue = DelayedByDistance(distance_m=1.0), DelayedByDistanceState()
    assert [due(stage, queue, n, 0.0) for n in range(4)] == [[], [], [0], [1]]
    assert queue.seen_at_m == [0.0, 0.0]
    assert due(stage, queue, 4, 5.0) == [2, 3]


def test_corrections_come_before_what_is_due_and_repeat_nothing_that_waits() -> None:
    stage, queue = DelayedByDistance(distance_m=9.0), DelayedByDistanceState()
    for n in range(3):
        due(stage, queue, n, 1.0 if n else None)
    corrections = MapUpdates((MapUpdate(VIEW, STATE, 1, reconstructed=True),))
    out = stage.step(at_tick(3, first=True), VIEW, STATE, None, queue, corrections)
    assert [(update.index, update.reconstructed) for update in out.updates.items] == [(0, False), (1, True), (2, False)]
    assert out.updates.open_from is None
    assert [update.index for update in out.waiting.items] == [3]
