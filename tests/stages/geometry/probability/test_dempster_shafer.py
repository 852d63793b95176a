"""Evidence against numbers worked by hand (erratum 30) and against the rule written out over sets."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omninav.stages.geometry.probability.dempster_shafer import (
    SUPPORT,
    UNKNOWN,
    combine,
    confidence,
    gather,
    masses,
    similarity_of,
)

share = st.floats(0.0, 1.0)


def by_sets(one: np.ndarray, other: np.ndarray) -> list[float]:
    """Dempster's rule over all pairs of sets (equation 6)."""
    sets = [frozenset("H"), frozenset("n"), frozenset("Hn")]
    found, conflict = dict.fromkeys(sets, 0.0), 0.0
    for (a, m), (b, n) in itertools.product(zip(sets, one, strict=True), zip(sets, other, strict=True)):
        if a & b:
            found[a & b] += m * n
        else:
            conflict += m * n
    return [found[s] / (1.0 - conflict) for s in sets]


def test_initial_masses_are_those_worked_by_hand() -> None:
    found = masses([0.7, -1.0, 1.0, 2.0], [0.75, 0.75, -1.0, 2.0])
    assert found == pytest.approx(
        np.array([[0.525, 0.225, 0.25], [0.0, 0.75, 0.25], [0.0, 0.0, 1.0], [0.99, 0.0, 0.01]])
    )
    assert tuple(found[0, [SUPPORT, UNKNOWN]]) == pytest.approx((0.525, 0.25))


@pytest.mark.parametrize(("xi", "after"), [(0.4, [0.635, 0.195, 0.169]), (0.6, [0.702, 0.177, 0.121])])
def test_one_neighbour_adds_what_was_worked_by_hand(xi: float, after: list[float]) -> None:
    assert combine(masses(0.7, 0.75), masses(0.8, xi)) == pytest.approx(after, abs=6e-4)


@given(share, share, share, share)
def test_the_rule_is_dempsters_over_sets_in_any_order(s: float, xi: float, t: float, eta: float) -> None:
    one, other = masses(s, xi), masses(t, eta)
    assert combine(one, other) == pytest.approx(by_sets(one, other))
    assert combine(other, one) == pytest.approx(combine(one, other))
    assert combine(one, other).sum() == pytest.approx(1.0)
    assert combine(one, masses(t, 0.0)) == pytest.approx(one)  # who knows nothing changes nothing


def test_two_certain_opposites_are_not_quite_certain() -> None:
    assert combine(masses(1.0, 1.0), masses(0.0, 1.0)) == pytest.approx(np.array([99.0, 99.0, 1.0]) / 199.0)
    with pytest.raises(ValueError, match="contradict each other"):
        combine(np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]))


def test_confidence_falls_from_one_to_nothing_at_the_reach() -> None:
    assert confidence([0.0, 10.0, 20.0, 21.0], 20.0) == pytest.approx([1.0, 1.0 - math.sin(math.pi / 4), 0.0, 0.0])


def test_similarities_lie_between_nothing_and_one() -> None:
    falls = {"ratio": [1 / 2, 1 / 3], "gaussian": np.exp([-0.5, -2.0])}
    for form, expected in falls.items():
        assert similarity_of([0.0, 0.5, 1.0, math.inf], 0.5, form) == pytest.approx([1.0, *expected, 0.0])


def test_neighbours_speak_once_and_with_what_they_knew_before() -> None:
    initial = np.stack([masses(0.7, 0.75), masses(0.8, 0.75), masses(0.3, 0.75)])
    apart = np.array([[0.0, 10.0, 99.0], [10.0, 0.0, 99.0], [99.0, 99.0, 0.0]])
    told = gather(initial, apart, 20.0)
    xi = 1.0 - math.sin(math.pi / 4)
    assert told[0] == pytest.approx(combine(initial[0], masses(0.8, xi)))
    assert told[1] == pytest.approx(combine(initial[1], masses(0.7, xi)))  # not with what it has told since
    assert told[2] == pytest.approx(initial[2])  # alone
