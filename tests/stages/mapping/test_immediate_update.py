"""Lessons in the tick in which a view is seen."""

from made_beliefs import along_x
from made_view_maps import view

from omninav.pipeline import Context
from omninav.stages.mapping.immediate_update import ImmediateUpdate

VIEW = view(1.0)


def test_a_view_is_a_lesson_at_once_with_its_whole_state():
    out = ImmediateUpdate().step(Context("lessons"), view=VIEW, state=along_x(0.0, 1.0))
    (lesson,) = out.updates.items
    assert lesson.view is VIEW
    assert len(lesson.state) == 2
    assert (lesson.index, lesson.reconstructed) == (0, False)


def test_a_state_without_any_place_teaches_nothing():
    assert ImmediateUpdate().step(Context("lessons"), view=VIEW, state=along_x()).updates.items == ()
