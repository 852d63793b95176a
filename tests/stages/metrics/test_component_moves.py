import numpy as np
import pytest
from measured_drives import figures

from omninav.stages.metrics.component_moves import ComponentMoves, moves
from omninav.stages.values.view_mixtures import MixturesNow


def now(*places: tuple[int, float]) -> MixturesNow:
    """Components of views: the view's id and x."""
    ids, means = np.array([name for name, _ in places]), np.array([[x, 0.0, 0.0] for _, x in places], np.float32)
    return MixturesNow(ids, means, np.ones(len(places), np.float32))


def measured(*ticks: MixturesNow | None) -> dict:
    return figures(ComponentMoves(), ticks)["component_moves"]


def needs(monkeypatch: pytest.MonkeyPatch, moves: int, components: int = 10) -> None:
    """So many moves make a component count, and so many components a curve."""
    monkeypatch.setattr("omninav.stages.metrics.component_moves.MIN_MOVES", moves)
    monkeypatch.setattr("omninav.stages.metrics.component_moves.MIN_COMPONENTS", components)


def test_a_component_is_followed_from_update_to_update():
    ticks = [now((1, 0.0)), None, now((1, 0.5)), now((1, 0.5)), now((1, 0.75), (2, 9.0)), now((1, 0.75), (1, 5.0))]
    # An update that leaves the mean where it is moves nothing; a place far off is another one.
    assert moves(ticks, 1.0) == [[0.5, 0.25], [], []]


def test_every_entry_is_of_the_same_components(monkeypatch: pytest.MonkeyPatch):
    # Ten that move twice by 0.25 and 0.5, and ten that move once, by 1.0, and are in neither entry.
    first = [(view, 0.0) for view in range(20)]
    then = [(view, 0.25) for view in range(10)] + [(view, 1.0) for view in range(10, 20)]
    last = [(view, 0.75) for view in range(10)]
    needs(monkeypatch, moves=2)
    found = measured(now(*first), now(*then), now(*last))
    assert found == {"updates": [0, 1], "moved_m": [0.25, 0.5], "components": 10}


def test_only_the_first_moves_of_a_component_count(monkeypatch: pytest.MonkeyPatch):
    needs(monkeypatch, moves=2, components=1)
    found = measured(*(now((1, x)) for x in (0.0, 0.5, 0.75, 0.875)))
    assert found == {"updates": [0, 1], "moved_m": [0.5, 0.25], "components": 1}


def test_a_curve_of_few_components_is_left_out():
    nine, ten = ([now(*((view, x) for view in range(n))) for x in (0.0, 0.5, 0.25, 0.5)] for n in (9, 10))
    assert measured(*nine) == {"updates": [], "moved_m": [], "components": 9}
    assert measured(*ten)["updates"] == [0, 1, 2]
    assert measured(*ten[:-1])["components"] == 0


def test_a_component_is_the_nearest_of_its_view_and_beyond_a_metre_another(monkeypatch: pytest.MonkeyPatch):
    ticks = [now((1, 0.0), (1, 0.75)), now((1, 0.125), (1, 1.75))]
    assert moves(ticks, 1.0) == [[0.125], [1.0]]
    assert moves(ticks, 0.99) == [[0.125], [], []]
    needs(monkeypatch, moves=2, components=1)
    assert [measured(*(now((1, x)) for x in (0.0, 1.0, last)))["components"] for last in (2.1, 2.0)] == [0, 1]


def test_of_two_near_one_component_the_second_is_another():
    ticks = [now((1, 0.0)), now((1, 0.25), (1, 0.5)), now((1, 0.25), (1, 0.75))]
    assert moves(ticks, 1.0) == [[0.25], [0.25]]
