"""Updates with which a map is learned again."""

import pytest
from made_beliefs import along_x
from made_view_maps import view

from omninav.stages.mapping.view_updates import PendingUpdates, start_over
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
