"""Updates with which a map is learned again."""

import numpy as np
import pytest
from made_beliefs import along_x
from made_view_maps import learned, view

from omninav.stages.mapping.view_updates import PendingUpdates, start_over, view_event, within_cap
from omninav.stages.values.map_update import MapUpdate, MapUpdates
from omninav.stages.values.sessions import Sessions
from omninav.stages.values.view_mixtures import ViewMixtures

VIEW = view(0.0)
UPDATES = tuple(MapUpdate(VIEW, along_x(0.0), n) for n in range(3))


@pytest.mark.parametrize("relearn", [True, False])
def test_a_map_that_is_learned_again_forgets_its_views_and_what_waits(relearn: bool) -> None:
    map, before = ViewMixtures.empty(), PendingUpdates(waiting=list(UPDATES))
    map.add_view(VIEW.values, "Coefficients")
    start_over(MapUpdates((), relearn=relearn), map, before)
    assert (len(map), len(before.waiting)) == ((0, 0) if relearn else (1, 3))


def test_drives_that_come_with_updates_are_kept_and_stay() -> None:
    map, before, sessions = ViewMixtures.empty(), PendingUpdates(), Sessions.empty(VIEW)
    start_over(MapUpdates((), sessions=sessions), map, before)
    assert map.sessions is sessions
    start_over(MapUpdates(()), map, before)
    start_over(None, map, before)
    assert map.sessions is sessions


def made_map(weights, counts=None):
    """Views 0, 1 and so on, each learned in a step of its own; their parts are at (view, part)."""
    map = ViewMixtures.empty()
    for name, shares in enumerate(weights):
        places = [(name, part, 0.0) for part in range(len(shares))]
        learned(name, *places, weights=tuple(shares), count=1.0 if counts is None else counts[name], map=map).step()
    return map


def test_an_event_names_what_came_and_what_went():
    map = made_map([[0.5], [0.2], [0.9]])
    before = map.ids
    map.keep_views(np.array([True, False, True]))
    learned(7.0, map=map)
    event = view_event(map, before, np.array([2, 2, 1]), {3: 17}, "forgotten")
    assert (event.views, event.components) == (3, 2)
    assert event.inserted.tolist() == [3]
    assert event.seen.tolist() == [17]
    assert event.removed.tolist() == [1]
    assert event.why == "forgotten"
    assert event.changed.tolist() == [2], "each once, and none that is gone"


def test_an_event_has_the_heaviest_part_of_each_changed_view():
    map = made_map([[0.1, 0.6, 0.3], [0.2], []])
    event = view_event(map, map.ids, np.array([2, 0, 1]), {})
    assert event.changed.tolist() == [0, 1, 2]
    assert event.weights.tolist() == [0.6, 0.2, 0.0]
    assert event.places.tolist() == [[0.0, 1.0], [1.0, 0.0], [0.0, 0.0]]
    assert event.parts.tolist() == [3, 1, 0]
    assert event.why == ""


def test_above_the_limit_the_views_of_the_least_weight_go_first():
    assert within_cap(made_map([[0.5], [0.2, 0.1], [0.9], [0.4]]), 2).tolist() == [True, False, True, False]
    assert within_cap(made_map([[0.5], [0.2]]), 2).all()
    assert within_cap(made_map([[0.5], [0.2]]), 0).all(), "0: no limit"


def test_of_equally_heavy_views_those_seldom_seen_go_first_and_then_the_oldest():
    assert within_cap(made_map([[1.0]] * 3, counts=[5, 1, 5]), 1).tolist() == [False, False, True]


def test_a_view_of_this_very_step_stays_though_it_has_no_weight_yet():
    map = made_map([[0.5], [0.2]])
    learned(7.0, map=map)
    assert within_cap(map, 2).tolist() == [True, False, True]
