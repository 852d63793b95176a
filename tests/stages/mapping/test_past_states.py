"""Past states corrected along the odometry."""

from typing import Any

import numpy as np
import pytest

from omninav.pipeline import Context, Tick
from omninav.stages.geometry.plane.odometry_motion import move_gaussians
from omninav.stages.mapping.past_states import CorrectPastStates, CorrectPastStatesState
from omninav.stages.values.belief import GaussianMixture
from omninav.stages.values.map_update import MapUpdates
from omninav.stages.values.pose import UncertainMotion
from omninav.stages.values.view_mixtures import ViewMixtures
from omninav.stages.values.views import Coefficients, Neighbours

VIEW = Coefficients(np.zeros(2, np.float32), np.zeros((1, 2), np.float32))


def around_a_square(
    end: tuple[float, float, float], **options: Any
) -> tuple[dict[int, GaussianMixture], list[MapUpdates]]:
    """The corrections on a square of four metres, five images a side, by odometry alone up to the last image; there a
    view of the map gives the pose `end`."""
    stage, path, ctx = CorrectPastStates(**options), CorrectPastStatesState(), Context("past_states")
    map = ViewMixtures.empty()
    map.add_view(VIEW.values, "Coefficients")
    none = Neighbours(np.empty(0, np.int64), np.empty(0), np.empty(0), np.empty(0), np.inf)
    seen = Neighbours(np.zeros(1, np.int64), np.zeros(1), np.ones(1), np.zeros(1), 0.0)
    certain = np.diag([0.02, 0.02, 0.02])[None] ** 2
    means, covariances = np.zeros((1, 3)), certain
    states, out = {}, []
    for n in range(21):
        ctx.tick = Tick(n, n, 0, n, n == 0)
        model = None if n == 0 else UncertainMotion((np.pi / 2 if n % 5 == 1 and n > 1 else 0.0, 0.8, 0.0), (0.05,) * 3)
        if model is not None:
            means, covariances = move_gaussians(means, covariances, model.steps, model.sigmas)
        state = GaussianMixture(means, covariances, np.ones(1))
        if n == 20:
            state = GaussianMixture(np.array([end]), certain, np.ones(1))
        states[n] = state
        out.append(stage.step(ctx, VIEW, state, model, path, seen if n == 20 else none, map).corrections)
    return states, out


def test_where_the_path_closes_the_states_on_it_are_corrected_along_odometry() -> None:
    # Odometry leads back to (0, 0), the map says (0.4, 0): the path in between is shifted, more the nearer to the end.
    before, corrections = around_a_square((0.4, 0.0, -np.pi / 2))
    assert all(tick.open_from == 0 for tick in corrections)
    assert not any(tick.items for tick in corrections[:-1])
    after = {update.index: update.state for update in corrections[-1].items}
    assert set(after) >= set(range(3, 19))
    shift = {n: float(np.hypot(*(state.means[0] - before[n].means[0])[:2])) for n, state in after.items()}
    assert shift[4] < 0.1 < shift[16] < 0.45
    for n, state in after.items():
        assert np.linalg.det(state.covariances[0]) < np.linalg.det(before[n].covariances[0])


@pytest.mark.parametrize(
    ("end", "options"),
    [((0.4, 0.0, -np.pi / 2), {"back_propagate": False}), ((9.0, 0.0, -np.pi / 2), {})],
    ids=["where it is switched off", "where odometry does not explain the end"],
)
def test_states_stay(end: tuple[float, float, float], options: dict[str, bool]) -> None:
    _, corrections = around_a_square(end, **options)
    assert len(corrections) == 21
    assert not any(tick.items for tick in corrections)
