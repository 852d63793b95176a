"""Comparisons of views against where they were taken, worked by hand."""

import dataclasses

import numpy as np
import pytest
from made_tour import Landmarks, along, mapped, scattered

from omninav.pipeline import Context
from omninav.stages.metrics.compared_pairs import ComparedPairs, against_metres
from omninav.stages.values.local_features import GlobalDescriptor
from omninav.stages.values.rooms import Rooms

LINE = [(5.0, 5.0), (15.0, 5.0)]


def test_shares_of_pairs_that_pass_the_colours_by_room(monkeypatch: pytest.MonkeyPatch) -> None:
    views = mapped(Landmarks(scattered(20.0, 10.0)), [along(LINE, 2.0)]).views
    assert len(views) == 5  # at x = 5, 7, 9, 11, 13
    colours = [0.0, 0.0, 0.5, 0.9, 0.4]
    descriptors = tuple(GlobalDescriptor(np.array([value, 0.0, 0.0], np.float32)) for value in colours)
    views = dataclasses.replace(views, descriptors=descriptors)
    rooms = Rooms(("west", "east"), np.array([[0.0, 0.0, 10.0, 10.0], [10.0, 0.0, 20.0, 10.0]]))
    monkeypatch.setattr("omninav.stages.metrics.compared_pairs.MAX_GLOBAL_DISTANCE", 0.45)
    found = ComparedPairs().step(Context("pairs"), views, rooms).metrics.values["comparison"]
    assert found["passed_rate"] == pytest.approx(5 / 10)  # 0 with 0.4, 0 with 0, 0.5 with 0.4 and 0.9
    assert found["own_room_left_out"] == pytest.approx(3 / 4)  # three pairs in the west, one in the east
    assert found["other_rooms_left_out"] == pytest.approx(2 / 6)


def test_colours_of_a_place_in_two_lights_against_those_of_two_rooms(monkeypatch: pytest.MonkeyPatch) -> None:
    views = mapped(Landmarks(scattered(20.0, 10.0)), [along(LINE, 2.0)]).views  # at x = 5, 7, 9, 11, 13
    here, there = [0.0, 0.0, 0.0, 0.4, 0.4], [0.1, 0.0, 0.2, None, 0.9]

    def colours(values: list[float | None]) -> list[GlobalDescriptor | None]:
        return [None if each is None else GlobalDescriptor(np.array([each, 0.0, 0.0], np.float32)) for each in values]

    shown = [each for each in colours([*here]) if each is not None]
    views = dataclasses.replace(views, descriptors=tuple(shown), frames=np.array([1, 2, 3, 4, 5]))
    rooms = Rooms(("west", "east"), np.array([[0.0, 0.0, 10.0, 10.0], [10.0, 0.0, 20.0, 10.0]]))
    lit = colours([None, *there])  # the first image became no view
    monkeypatch.setattr("omninav.stages.metrics.compared_pairs.MAX_GLOBAL_DISTANCE", 0.45)
    found = ComparedPairs().step(Context("pairs"), views, rooms, lit)
    two = found.metrics.values["comparison"]["two_lights"]
    assert two["passed_rate"] == pytest.approx(3 / 4)
    assert two["change"] == pytest.approx(0.15 / 0.4)  # the median of 0.1, 0, 0.2 and 0.5 over 0.4
    known = dataclasses.replace(views, frames=np.array([7, 9, 10, 11, 12]), owners=np.array([0, -1, -1, -1, -1]))
    monkeypatch.setattr("omninav.stages.metrics.compared_pairs.MAX_GLOBAL_DISTANCE", 0.45)
    found = ComparedPairs().step(Context("pairs"), known, None, colours([None, *there[1:]]))
    assert found.metrics.values["comparison"]["two_lights"] == {"passed_rate": pytest.approx(2 / 3), "change": None}


def test_visual_distances_by_rings_of_metres() -> None:
    found = against_metres(np.array([1.0, 2.0, 4.0, 3.0]), np.array([0.5, 1.5, 6.0, 8.0]), 8.0)
    assert found["rank_correlation"] == pytest.approx(0.8)
    assert found["by_metres"] == {"to_m": [1.0, 2.0, 4.0, 8.0], "median": [1.0, 2.0, None, 3.5]}
    assert against_metres(np.ones(3), np.ones(3), 8.0)["rank_correlation"] is None


def test_only_pairs_within_eight_metres_that_have_something_in_common_are_ranked(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    views = mapped(Landmarks(scattered(20.0, 10.0)), [along(LINE, 2.0)]).views  # at x = 5, 7, 9, 11, 13
    distances = np.full((5, 5), np.inf)
    for (one, other), distance in {(0, 1): 1.0, (1, 2): 3.0, (0, 2): 4.0, (0, 3): 5.0, (0, 4): 9.0}.items():
        distances[one, other] = distances[other, one] = distance
    views = dataclasses.replace(views, distances=distances)
    found = ComparedPairs().step(Context("pairs"), views).metrics.values["comparison"]
    assert found["by_metres"] == {"to_m": [1.0, 2.0, 4.0, 8.0], "median": [None, 2.0, 4.0, 7.0]}
    assert found["rank_correlation"] > 0.9
    monkeypatch.setattr("omninav.stages.metrics.compared_pairs.WITHIN_M", 6.5)
    near = ComparedPairs().step(Context("pairs"), views).metrics.values["comparison"]["by_metres"]
    assert near["median"] == [None, None, 2.0, 4.5]
    assert (found["own_room_left_out"], found["other_rooms_left_out"]) == (None, None)


def test_where_poses_are_not_true_only_colours_are_compared() -> None:
    views = mapped(Landmarks(scattered(20.0, 10.0)), [along(LINE, 2.0)]).views
    colours = [0.0, 0.5, 0.5, 1.1, 1.1]
    descriptors = tuple(GlobalDescriptor(np.array([value, 0.0, 0.0], np.float32)) for value in colours)
    views = dataclasses.replace(views, descriptors=descriptors, pose_source="odometry")
    rooms = Rooms(("all",), np.array([[0.0, 0.0, 20.0, 10.0]]))
    found = ComparedPairs().step(Context("pairs"), views, rooms).metrics.values["comparison"]
    assert found["passed_rate"] == pytest.approx(4 / 10)  # half apart passes, 0.6 does not
    assert "by_metres" not in found
    assert (found["own_room_left_out"], found["other_rooms_left_out"]) == (None, None)


def test_a_view_outside_of_all_rooms_is_in_none() -> None:
    views = mapped(Landmarks(scattered(20.0, 10.0)), [along(LINE, 2.0)]).views
    colours = [0.0, 0.9, 0.0, 0.0, 0.0]
    descriptors = tuple(GlobalDescriptor(np.array([value, 0.0, 0.0], np.float32)) for value in colours)
    rooms = Rooms(("west",), np.array([[0.0, 0.0, 8.0, 10.0]]))
    given = dataclasses.replace(views, descriptors=descriptors)
    found = ComparedPairs().step(Context("pairs"), given, rooms).metrics.values["comparison"]
    assert (found["own_room_left_out"], found["other_rooms_left_out"]) == (1.0, None)


def test_a_rank_needs_three_pairs_that_vary() -> None:
    for distances, metres in (
        ([1.0, 2.0], [1.0, 2.0]),
        ([1.0, 1.0, 1.0], [1.0, 2.0, 3.0]),
        ([1.0, 2.0, 3.0], [1.0] * 3),
    ):
        assert against_metres(np.array(distances), np.array(metres), 8.0)["rank_correlation"] is None
    little = against_metres(np.array([0.25, 0.5, 1.0]), np.array([1.0, 1.25, 1.5]), 8.0)
    assert little["rank_correlation"] == pytest.approx(1.0)
    assert little["by_metres"]["median"] == [0.25, 0.75, None, None]
    three = against_metres(np.array([1.0, 2.0, 9.0]), np.full(3, 5.0), 8.0)
    assert three["by_metres"]["median"] == [None, None, None, 2.0]
    rising = against_metres(np.array([1.0, 2.0, 9.0]), np.array([1.0, 2.0, 3.0]), 8.0)
    assert rising["rank_correlation"] == pytest.approx(1.0)
    assert rising["by_metres"]["median"] == [1.0, 2.0, 9.0, None]  # an edge belongs to the inner ring
