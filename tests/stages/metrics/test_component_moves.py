import numpy as np
import pytest

from omninav.pipeline import Context
from omninav.stages.metrics.component_moves import ComponentMoves, moves
from omninav.stages.values.view_mixtures import MixturesNow


def now(*places: tuple[int, float]) -> MixturesNow:
    """Components of views: the view's id and x."""
    ids, means = np.array([name for name, _ in places]), np.array([[x, 0.0, 0.0] for _, x in places], np.float32)
    return MixturesNow(ids, means, np.ones(len(places), np.float32))


def test_a_component_is_followed_from_update_to_update():
    ticks = [now((1, 0.0)), None, now((1, 0.5)), now((1, 0.5)), now((1, 0.75), (2, 9.0)), now((1, 0.75), (1, 5.0))]
    # An update that leaves the mean where it is moves nothing; a place far off is another one.
    assert moves(ticks, 1.0) == [(0, 0.5), (1, 0.25)]


def test_a_running_mean_moves_less_with_every_update():
    places, rng = np.zeros(40), np.random.default_rng(0)
    ticks = []
    for update in range(12):
        seen = rng.normal(0.0, 0.2, 40)
        places = places + (seen - places) / (update + 1)
        ticks += [now((view, x)) for view, x in enumerate(places.tolist())]
    found = ComponentMoves().step(Context("metric"), ticks).metrics.values["component_moves"]
    assert found["updates"] == list(range(11))
    assert found["moves"] == [40] * 11
    assert found["moved_m"][-1] < 0.2 * found["moved_m"][0]
    assert found["moved_m"][0] == pytest.approx(0.2 * np.sqrt(1 / np.pi), rel=0.3)  # half the gap between two draws


def test_numbers_with_few_moves_end_the_list():
    found = ComponentMoves(min_moves=2).step(Context("metric"), [now((1, 0.0)), now((1, 0.5))])
    assert found.metrics.values["component_moves"]["updates"] == []


def test_a_component_is_the_nearest_of_its_view_and_beyond_a_metre_another():
    ticks = [now((1, 0.0), (1, 0.75)), now((1, 0.125), (1, 1.75))]
    assert moves(ticks, 1.0) == [(0, 0.125), (0, 1.0)]
    assert moves(ticks, 0.99) == [(0, 0.125)]


def test_an_entry_is_the_mean_of_as_many_moves_as_it_needs():
    ticks = [now((1, 0.0), (2, 0.0), (3, 0.0)), now((1, 0.25), (2, 0.25), (3, 1.0))]
    found = ComponentMoves(min_moves=3).step(Context("metric"), ticks).metrics.values["component_moves"]
    assert found == {"updates": [0], "moved_m": [0.5], "moves": [3]}
    ten = [now(*((view, 0.0) for view in range(10))), now(*((view, 0.5) for view in range(10)))]
    assert ComponentMoves().step(Context("m"), ten).metrics.values["component_moves"]["moves"] == [10]
    nine = [now(*((view, 0.0) for view in range(9))), now(*((view, 0.5) for view in range(9)))]
    assert ComponentMoves().step(Context("m"), nine).metrics.values["component_moves"]["moves"] == []


def test_beyond_a_metre_is_another_place_unless_asked_for():
    ticks = [now((1, 0.0), (2, 0.0)), now((1, 1.0), (2, 1.5))]
    found = ComponentMoves(min_moves=1).step(Context("metric"), ticks).metrics.values["component_moves"]
    assert found == {"updates": [0], "moved_m": [1.0], "moves": [1]}
