"""The map of views before the first drive, and what is left to learn after the last."""

from omninav.pipeline import Context, Tick
from omninav.stages.mapping.flush_pending import FlushPending
from omninav.stages.mapping.initial_view_mixtures import InitialViewMixtures
from omninav.stages.values.map_update import MapUpdates
from omninav.stages.values.view_mixtures import ViewMixtures


def test_a_known_map_is_gone_on_with_and_else_an_empty_one_begun() -> None:
    stage, known = InitialViewMixtures(), ViewMixtures.empty()
    assert stage.step(Context("map"), known).map is known
    begun = stage.step(Context("map")).map
    assert begun is not known
    assert len(begun) == 0


def test_after_the_last_log_all_that_waits_is_given() -> None:
    waiting = MapUpdates(())
    assert FlushPending().step(Context("flush"), [Tick(0, 0)], waiting).updates is waiting
    assert FlushPending().step(Context("flush"), [Tick(0, 0)]).updates is None
