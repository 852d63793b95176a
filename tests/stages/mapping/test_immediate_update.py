"""Lessons in the tick in which a view is seen."""

import numpy as np

from omninav.pipeline import Context
from omninav.stages.mapping.immediate_update import ImmediateUpdate
from omninav.stages.values.belief import GaussianMixture
from omninav.stages.values.views import Coefficients

VIEW = Coefficients(np.ones(2, np.float32), np.ones((1, 2), np.float32))


def mixture(parts):
    return GaussianMixture(np.zeros((parts, 3)), np.stack([np.eye(3)] * parts).reshape(-1, 3, 3), np.ones(parts))


def test_a_view_is_a_lesson_at_once_with_its_whole_state():
    out = ImmediateUpdate().step(Context("lessons"), view=VIEW, state=mixture(2))
    (lesson,) = out.updates.items
    assert lesson.view is VIEW
    assert len(lesson.state) == 2
    assert (lesson.index, lesson.reconstructed) == (0, False)


def test_a_state_without_any_place_teaches_nothing():
    assert (
        ImmediateUpdate()
        .step(Context("lessons"), view=VIEW, state=GaussianMixture(np.empty((0, 3)), np.empty((0, 3, 3)), np.empty(0)))
        .updates.items
        == ()
    )
