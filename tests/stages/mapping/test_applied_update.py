"""What is kept of an update so that it can be undone."""

import numpy as np
import pytest
from made_beliefs import along_x
from made_view_maps import learned

from omninav.stages.mapping.applied_update import AppliedUpdate, record_update
from omninav.stages.values.view_mixtures import ViewMixtures

TURNS, ALIKE = np.array([0.1, 0.2, 0.3]), np.array([0.9, 0.8, 0.7])


def made_map() -> ViewMixtures:
    """Views 0 to 3 with one, two, one and three components at x = 10 view + component."""
    map = ViewMixtures.empty()
    for view, parts in enumerate((1, 2, 1, 3)):
        learned(
            view, *(10.0 * view + part for part in range(parts)), weights=tuple(np.arange(1, parts + 1) / 8), map=map
        )
    return map


def recorded(map: ViewMixtures, ids: list[int]) -> AppliedUpdate:
    number = len(ids)
    return record_update(along_x(0.0), 7, np.array(ids), TURNS[:number], ALIKE[:number], map)


def places(applied: AppliedUpdate) -> list[list[float]]:
    return [means[:, 0].tolist() for means, _, _, _ in applied.places()]


def test_the_components_of_its_views_are_recorded_each_with_its_own() -> None:
    applied = recorded(made_map(), [1, 2, 3])
    assert places(applied) == [[10.0, 11.0], [20.0], [30.0, 31.0, 32.0]]
    _, _, weights, counts = next(applied.places())
    assert (weights.tolist(), counts.tolist()) == ([0.125, 0.25], [3.0, 3.0])


@pytest.mark.parametrize("dropped", [None, 0])
def test_undone_the_views_have_what_they_had_and_the_others_what_they_have(dropped: int | None) -> None:
    map = made_map()
    applied = recorded(map, [1, 3])
    if dropped is not None:
        map.keep_views(np.arange(4) != dropped)
        applied = applied.within(map)
    row = int(applied.rows(map)[0])
    map.put_mixtures(np.array([row]), np.full((1, 3), 99.0), np.eye(3)[None], np.ones(1), np.ones(1))
    applied.undo(map)
    found = {int(map.ids[owner]): sorted(map.means[map.owner == owner, 0].tolist()) for owner in range(len(map))}
    expected = {0: [0.0], 1: [10.0, 11.0], 2: [20.0], 3: [30.0, 31.0, 32.0]}
    assert found == {view: places for view, places in expected.items() if view != dropped}


def test_of_views_that_the_map_has_dropped_nothing_is_kept() -> None:
    map = made_map()
    applied = recorded(map, [0, 1, 3])
    map.keep_views(np.array([True, False, True, True]))
    rest = applied.within(map)
    assert rest.ids.tolist() == [0, 3]
    assert (rest.turns.tolist(), rest.similarities.tolist()) == ([0.1, 0.3], [0.9, 0.7])
    assert places(rest) == [[0.0], [30.0, 31.0, 32.0]]
    assert rest.rows(map).tolist() == [0, 2]
    assert rest.index == 7
