"""Comparisons of views against where they were taken, worked by hand."""

import dataclasses

import numpy as np
import pytest
from made_views import made_views
from measured_drives import figures, on_x

from omninav.stages.metrics.compared_pairs import ComparedPairs, against_metres
from omninav.stages.values.compared_views import ComparedViews
from omninav.stages.values.local_features import GlobalDescriptor
from omninav.stages.values.rooms import Rooms

MODULE = "omninav.stages.metrics.compared_pairs"
WEST_AND_EAST = Rooms(("west", "east"), np.array([[0.0, 0.0, 10.0, 10.0], [10.0, 0.0, 20.0, 10.0]]))


def coloured(*values: float | None) -> tuple[GlobalDescriptor | None, ...]:
    return tuple(None if each is None else GlobalDescriptor(np.array([each, 0.0, 0.0], np.float32)) for each in values)


def views_of(*colours: float, distances=None, **changed) -> ComparedViews:
    """Five views of these colours, taken at x = 5, 7, 9, 11 and 13, with nothing in common where nothing is said."""
    found = np.full((5, 5), np.inf)
    for (one, other), distance in (distances or {}).items():
        found[one, other] = found[other, one] = distance
    views = made_views(found, poses=np.array(on_x(range(5, 14, 2), 5.0)), pose_source="truth")
    return dataclasses.replace(views, descriptors=coloured(*colours), **changed)


def compared(*given) -> dict:
    return figures(ComparedPairs(), *given)["comparison"]


def test_shares_of_pairs_that_pass_the_colours_by_room(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(f"{MODULE}.MAX_GLOBAL_DISTANCE", 0.45)
    found = compared(views_of(0.0, 0.0, 0.5, 0.9, 0.4), WEST_AND_EAST)
    assert found["passed_rate"] == pytest.approx(5 / 10)  # 0 with 0.4, 0 with 0, 0.5 with 0.4 and 0.9
    assert found["own_room_left_out"] == pytest.approx(3 / 4)  # three pairs in the west, one in the east
    assert found["other_rooms_left_out"] == pytest.approx(2 / 6)


def test_colours_of_a_place_in_two_lights_against_those_of_two_rooms(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(f"{MODULE}.MAX_GLOBAL_DISTANCE", 0.45)
    here, lit = (0.0, 0.0, 0.0, 0.4, 0.4), (0.0, 0.2, None, 0.9)
    views = views_of(*here, frames=np.array([1, 2, 3, 4, 5]))
    two = compared(views, WEST_AND_EAST, coloured(None, 0.1, *lit))["two_lights"]  # the first image became no view
    assert two["passed_rate"] == pytest.approx(3 / 4)
    assert two["change"] == pytest.approx(0.15 / 0.4)  # the median of 0.1, 0, 0.2 and 0.5 over 0.4
    known = views_of(*here, frames=np.array([7, 9, 10, 11, 12]), owners=np.array([0, -1, -1, -1, -1]))
    found = compared(known, None, coloured(None, *lit))
    assert found["two_lights"] == {"passed_rate": pytest.approx(2 / 3), "change": None}


def test_only_pairs_within_eight_metres_that_have_something_in_common_are_ranked(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    views = views_of(*[0.0] * 5, distances={(0, 1): 1.0, (1, 2): 3.0, (0, 2): 4.0, (0, 3): 5.0, (0, 4): 9.0})
    found = compared(views)
    assert found["by_metres"] == {"to_m": [1.0, 2.0, 4.0, 8.0], "median": [None, 2.0, 4.0, 7.0]}
    assert found["rank_correlation"] > 0.9
    assert (found["own_room_left_out"], found["other_rooms_left_out"]) == (None, None)
    monkeypatch.setattr(f"{MODULE}.WITHIN_M", 6.5)
    assert compared(views)["by_metres"]["median"] == [None, None, 2.0, 4.5]


def test_where_poses_are_not_true_only_colours_are_compared() -> None:
    rooms = Rooms(("all",), np.array([[0.0, 0.0, 20.0, 10.0]]))
    found = compared(views_of(0.0, 0.5, 0.5, 1.1, 1.1, pose_source="odometry"), rooms)
    assert found["passed_rate"] == pytest.approx(4 / 10)  # half apart passes, 0.6 does not
    assert "by_metres" not in found
    assert (found["own_room_left_out"], found["other_rooms_left_out"]) == (None, None)


def test_a_view_outside_of_all_rooms_is_in_none() -> None:
    found = compared(views_of(0.0, 0.9, 0.0, 0.0, 0.0), Rooms(("west",), np.array([[0.0, 0.0, 8.0, 10.0]])))
    assert (found["own_room_left_out"], found["other_rooms_left_out"]) == (1.0, None)


@pytest.mark.parametrize(
    ("distances", "metres", "rank", "medians"),
    [
        pytest.param([1, 2, 4, 3], [0.5, 1.5, 6, 8], 0.8, [1.0, 2.0, None, 3.5], id="in rings"),
        pytest.param([0.25, 0.5, 1], [1, 1.25, 1.5], 1.0, [0.25, 0.75, None, None], id="less than a metre apart"),
        pytest.param([1, 2, 9], [1, 2, 3], 1.0, [1.0, 2.0, 9.0, None], id="an edge belongs to the inner ring"),
        pytest.param([1, 2], [1, 2], None, [1.0, 2.0, None, None], id="a rank needs three pairs"),
        pytest.param([1, 1, 1], [1, 2, 3], None, [1.0, 1.0, 1.0, None], id="that do not look alike"),
        pytest.param([1, 2, 9], [5, 5, 5], None, [None, None, None, 2.0], id="at several distances"),
    ],
)
def test_visual_distances_by_rings_of_metres(distances, metres, rank, medians) -> None:
    assert against_metres(np.array(distances, float), np.array(metres, float), 8.0) == {
        "rank_correlation": rank if rank is None else pytest.approx(rank),
        "by_metres": {"to_m": [1.0, 2.0, 4.0, 8.0], "median": medians},
    }
