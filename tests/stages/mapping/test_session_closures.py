"""Which views of several drives are taken for one place."""

import numpy as np
import pytest

from omninav.stages.mapping.straightened_sessions import closures_between
from omninav.stages.values.sessions import Sessions
from omninav.stages.values.views import Coefficients


def view(look: float, turn: int = 0) -> Coefficients:
    """Four numbers around the robot, rolled by one where it stands a quarter turn clockwise."""
    ring = np.array([look, 0, 0, 0], np.float32)
    turned = np.stack([np.roll(ring, turn - n) for n in range(4)])
    return Coefficients(turned[0].copy(), turned)


def drives(*looks: list[float], turned: int = -1) -> Sessions:
    """Drives of views a metre apart; of which that of number `turned` is seen a quarter turn clockwise."""
    sessions, number = Sessions.empty(view(0.0)), 0
    for drive in looks:
        for row, look in enumerate(drive):
            sessions.move(np.array([1.0, 0.0, 0.0]))
            sessions.keep(view(look, int(number == turned)), None, row == 0, number)
            number += 1
    return sessions


def pairs(sessions: Sessions, max_distance: float = 0.5, min_gap_m: float = 2.0, samples: int = 100) -> list[list[int]]:
    return closures_between(sessions, max_distance, min_gap_m, samples).pairs.tolist()


def test_of_its_own_drive_a_view_closes_a_loop_some_metres_back() -> None:
    assert pairs(drives([10.0, 10.1, 10.2, 30.0])) == [[0, 2]]  # 0.2 is as near as can be at two metres
    assert pairs(drives([10.0, 10.1, 10.2, 30.0]), min_gap_m=1.0) == [[0, 1], [1, 2]]
    assert pairs(drives([10.0, 10.1, 10.2, 30.0]), min_gap_m=2.1) == []


def test_a_view_has_the_most_alike_of_each_earlier_drive() -> None:
    sessions = drives([10.0, 20.0, 30.0], [20.3, 50.0], [20.1, 30.2])
    assert pairs(sessions) == [[1, 3], [1, 5], [3, 5], [2, 6]]


def test_a_pair_counts_up_to_the_largest_distance() -> None:
    sessions = drives([10.0], [10.5])
    assert pairs(sessions, 0.5) == [[0, 1]]
    assert pairs(sessions, 0.49) == []


def test_only_so_many_views_look_for_partners_evenly_along_the_way() -> None:
    sessions = drives([10.0, 20.0, 30.0, 40.0, 50.0], [10.0, 20.0, 30.0, 40.0, 50.0])
    assert pairs(sessions) == [[n, n + 5] for n in range(5)]
    assert pairs(sessions, samples=4) == [[1, 6], [4, 9]]  # views 0, 3, 6 and 9


def test_turns_are_those_of_the_later_view_against_the_earlier() -> None:
    found = closures_between(drives([10.0, 20.0], [20.0, 10.0], turned=3), 0.5, 2.0, 100)
    assert found.pairs.tolist() == [[1, 2], [0, 3]]
    assert found.turns == pytest.approx([0.0, -np.pi / 2])  # a quarter further on it would see what it saw before


def test_one_view_closes_nothing() -> None:
    found = closures_between(drives([10.0]), 0.5, 2.0, 100)
    assert found.pairs.shape == (0, 2)
    assert found.turns.shape == (0,)
