"""Paths over a roadmap of two corridors with a wall between them."""

import numpy as np
import pytest

from omninav.stages.geometry.plane.roadmap import ahead_on, path_from, paths_to

# a corridor of 4 m to the right, and one back, 0.9 m beside it: driven as one, round the far end
X = np.arange(0.0, 4.1, 0.5)
POINTS = np.concatenate([np.column_stack([X, 0 * X]), np.column_stack([X[::-1], 0 * X + 0.9])])
DRIVEN = np.column_stack([np.arange(len(POINTS) - 1), np.arange(1, len(POINTS))]).astype(np.int64)
NONE = np.zeros(len(POINTS))


def test_no_way_leads_through_a_wall_that_is_between_two_corridors() -> None:
    paths = paths_to(np.array([0.0, 0.9]), POINTS, DRIVEN, 0.5, NONE)
    assert paths.metres[0] == pytest.approx(4.0 + 0.9 + 4.0)
    found = path_from(np.array([0.1, -0.1]), POINTS, paths, 0.5, 1.0)
    assert found.tolist()[:15] == list(range(1, 16))  # not from the nearest point, behind it


def test_two_passes_that_the_robot_overlaps_are_joined() -> None:
    paths = paths_to(np.array([0.0, 0.9]), POINTS, DRIVEN, 1.0, NONE)
    assert paths.metres[0] == pytest.approx(0.9)


def test_a_goal_beside_the_way_is_reached_from_its_nearest_points() -> None:
    paths = paths_to(np.array([2.0, -1.0]), POINTS, DRIVEN, 0.1, NONE)
    assert paths.next[4] == len(POINTS)
    assert paths.metres[4] == pytest.approx(1.0)
    assert path_from(np.array([2.0, -0.48]), POINTS, paths, 0.1, 0.52).tolist() == []


def test_a_way_that_was_blocked_is_taken_where_there_is_no_other() -> None:
    ring = np.vstack([DRIVEN, [[0, len(POINTS) - 1]]])
    blocked = np.where((POINTS[:, 1] > 0.5) & (POINTS[:, 0] == 2.0), 10.0, 0.0)
    around = paths_to(np.array([4.0, 0.9]), POINTS, ring, 0.1, blocked)
    straight = paths_to(np.array([4.0, 0.9]), POINTS, DRIVEN[9:], 0.1, blocked)
    assert around.metres[-1] == pytest.approx(0.9 + 4.0 + 0.9)
    assert straight.metres[[13, -1]] == pytest.approx([2.0 + 5.0, 4.0 + 10.0])
    assert path_from(np.array([0.0, 0.0]), POINTS, straight, 0.1, 4.1) is None


HAIRPIN = [[0.0, 0.0], [1.0, 0.0], [1.0, 5.0], [0.0, 5.0], [0.0, 0.4]]


@pytest.mark.parametrize(
    ("points", "place", "ahead", "expected"),
    [
        (3, (0.7, 0.2), 0.8, (1.0, 0.5, 4.5)),
        (3, (1.2, 2.0), 1.5, (1.0, 3.5, 1.5)),
        (3, (-1.0, 0.3), 0.8, (0.8, 0.0, 5.2)),  # before it begins
        (3, (1.0, 4.9), 5.5, (1.0, 5.0, 0.0)),
        (5, (0.3, 0.6), 5.0, (1.0, 4.3, 6.3)),  # not where it comes back, 7 m on
        (1, (3.0, 0.0), 0.8, (0.0, 0.0, 0.0)),
    ],
)
def test_what_lies_ahead_on_a_line_is_never_behind(points, place, ahead, expected) -> None:
    point, beyond = ahead_on(np.array(HAIRPIN[:points]), np.array(place), ahead)
    assert (*point, beyond) == pytest.approx(expected)
