"""Ways over a small map with a ring and a dead end, and what happens where they fail."""

import itertools

import numpy as np
import pytest
from made_places import made_map

from omninav.pipeline import Context, Tick
from omninav.pipeline.graph.problems import BadInput
from omninav.stages.planning.shortest_path import (
    ShortestPathPlanner,
    ShortestPathPlannerState,
    place_in_image,
    places_called,
    shortest_route,
)
from omninav.stages.values.belief import PlaceBelief
from omninav.stages.values.homing import DrivingStatus, PathProgress
from omninav.stages.values.topological_map import TopologicalMap
from omninav.stages.values.visual_distance import VisualDistances

# 0 - 1 - 2 - 3 in a row, 3 and 0 are neighbours by a loop, 4 hangs on 2 (driven from 4 to 2), 5 is on its own
BETWEEN = {(0, 1): 1, (1, 2): 0, (2, 3): 4, (4, 2): 2}
OPEN = {"failed_links": np.zeros((0, 2), np.int64), "failures": np.zeros(0, np.int64)}
TICKS = itertools.count()
MODULE = "omninav.stages.planning.shortest_path"


@pytest.fixture(autouse=True)
def plans_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(f"{MODULE}.SETTLE_S", 0.0)


def a_map() -> TopologicalMap:
    names = ("hall", "", "kitchen", "", "kitchen", "")
    return made_map([(0.0, 0.0)] * 6, BETWEEN, [(3, 0)], names)


def believed(place: int, share: float = 0.9) -> PlaceBelief:
    probabilities = np.full(6, (1.0 - share) / 5)
    probabilities[place] = share
    return PlaceBelief(probabilities, np.zeros((6, 3)))


def under_way(state: ShortestPathPlannerState, at: int, arrived: bool = False) -> PathProgress:
    views = int(state.views[-1])
    return PathProgress(state.number, at, views, at, at >= views - 1, False, arrived)


def drive(
    stage: ShortestPathPlanner,
    state: ShortestPathPlannerState,
    place: int,
    status=None,
    at: int | None = None,
    share=0.9,
    arrived=False,
):
    tick = Tick(0, 200_000_000 * next(TICKS))
    progress = None if at is None else under_way(state, at, arrived)
    doing = None if status is None else DrivingStatus(status, "a chair" if status == "blocked" else "too few matches")
    return stage.step(Context("planning"), state, tick, believed(place, share), a_map(), None, doing, progress)


def test_the_way_with_the_fewest_links_is_taken():
    assert shortest_route(a_map(), 0, np.array([3]), **OPEN).tolist() == [0, 3]
    assert shortest_route(a_map(), 1, np.array([4]), **OPEN).tolist() == [1, 2, 4]
    assert shortest_route(a_map(), 2, np.array([3]), **OPEN).tolist() == [2, 3]  # with the most views


def test_of_several_places_of_a_name_the_nearest_is_the_goal():
    goals = places_called("kitchen", a_map())
    assert goals.tolist() == [2, 4]
    assert shortest_route(a_map(), 3, goals, **OPEN).tolist() == [3, 2]


def test_a_way_driven_the_other_way_round_shows_its_pictures_backwards():
    map = a_map()
    there = map.views_along(np.array([4, 2, 1, 0]))
    back = map.views_along(np.array([0, 1, 2, 4]))
    assert there[0].tolist() == [4, 11, 12, 2, 1, 6, 0]
    assert back[0].tolist() == there[0].tolist()[::-1]
    assert there[1].tolist() == [1, 4, 5, 7]


@pytest.mark.parametrize("goal", ["cellar", 6, "-1", None, ""])
def test_a_goal_that_is_not_on_the_map_is_refused_with_those_that_are(goal):
    with pytest.raises(BadInput, match=r"hall, kitchen"):
        places_called(goal, a_map())


def test_a_name_that_is_nearly_one_of_the_map_is_offered_as_it_must_be_typed():
    named = made_map([(0.0, 0.0), (1.0, 0.0)], {(0, 1): 0}, names=["copy room", "kitchen"])
    with pytest.raises(BadInput, match=r"no place 'copyroom'; type 'goal=copy room' or a number below 2"):
        places_called("copyroom", named)
    with pytest.raises(BadInput, match="type goal=kitchen or"):
        places_called("kitchn", named)


def distances(*values: float) -> VisualDistances:
    return VisualDistances(np.array(values), np.zeros(len(values)), np.zeros(len(values), np.int64))


def test_a_picture_is_of_the_place_that_looks_most_like_it():
    stage = ShortestPathPlanner(goal="there.png")
    told = distances(0.4, np.inf, 0.2, 0.3, 0.5, np.inf)
    out = stage.step(Context("planning"), ShortestPathPlannerState(), Tick(0, 0), believed(0), a_map(), told)
    assert out.route.places.tolist() == [0, 1, 2]


def test_a_picture_of_no_place_is_refused_with_the_nearest():
    with pytest.raises(BadInput, match=r"there\.png is of no place .* place 4, kitchen, at a visual distance of 0\.70"):
        place_in_image("there.png", distances(0.9, np.inf, np.inf, np.inf, 0.7, np.inf), 0.5, a_map())
    with pytest.raises(BadInput, match="too little in common with any"):
        place_in_image("there.png", distances(*[np.inf] * 6), 0.5, a_map())


def test_it_plans_once_it_is_sure_and_not_again(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(f"{MODULE}.SETTLE_S", 0.2)
    monkeypatch.setattr(f"{MODULE}.LOCATE_TIMEOUT_S", 1.0)
    stage, state = ShortestPathPlanner(goal=3), ShortestPathPlannerState()
    first = drive(stage, state, 1, share=0.4)
    assert first.path is None
    assert first.route.state == "locating"
    second = drive(stage, state, 1, share=0.6)
    assert second.path is not None
    assert second.route.places.tolist() == [1, 0, 3]
    assert second.path.names == ("place 1", "on the way, image 60", "place 0, hall", "place 3")
    again = drive(stage, state, 0, "driving", at=2)
    assert again.path is None
    assert again.route.state == "under way"


def test_even_if_it_is_sure_it_looks_for_a_moment(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(f"{MODULE}.SETTLE_S", 0.6)
    stage, state = ShortestPathPlanner(goal=3), ShortestPathPlannerState()
    assert [drive(stage, state, 1).path is not None for _ in range(4)] == [False, False, False, True]


def test_who_looks_long_enough_goes_by_the_most_probable_place(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(f"{MODULE}.LOCATE_TIMEOUT_S", 0.6)
    stage, state = ShortestPathPlanner(goal=3), ShortestPathPlannerState()
    planned = [drive(stage, state, 2, share=0.3).path is not None for _ in range(4)]
    assert planned == [False, False, False, True]


def test_a_lost_target_means_a_new_way_from_where_it_is_now_believed():
    stage, state = ShortestPathPlanner(goal=3), ShortestPathPlannerState()
    drive(stage, state, 1)
    out = drive(stage, state, 2, "lost", at=1)
    assert out.path is not None
    assert out.path.number == 1
    assert out.route.places.tolist() == [2, 3]


def test_a_target_that_is_seen_again_in_time_leaves_the_way_as_it_is(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(f"{MODULE}.SETTLE_S", 0.4)
    stage, state = ShortestPathPlanner(goal=3), ShortestPathPlannerState()
    for _ in range(3):
        drive(stage, state, 1)
    waiting = drive(stage, state, 1, "lost", at=1)
    assert (waiting.route.state, waiting.route.why) == ("locating", "lost: too few matches")
    going = drive(stage, state, 1, "driving", at=1)
    assert (going.path, going.route.state, going.route.number, going.route.why) == (None, "under way", 0, "")


def test_around_a_link_that_failed_there_may_be_another_way():
    stage, state = ShortestPathPlanner(goal="hall"), ShortestPathPlannerState()
    assert drive(stage, state, 2).route.places.tolist() == [2, 1, 0]
    out = drive(stage, state, 1, "blocked", at=2)  # the medoids of 2 and 1 are reached: it is between 1 and 0
    assert state.failed_links.tolist() == [[1, 0]]
    assert out.route.places.tolist() == [1, 2, 3, 0]


def test_where_no_other_way_is_left_it_tries_some_times_and_then_gives_up_and_stands():
    stage, state = ShortestPathPlanner(goal=4), ShortestPathPlannerState()
    tried = [drive(stage, state, 2).route.places.tolist()]
    for _ in range(2):
        tried.append(drive(stage, state, 2, "blocked", at=1).route.places.tolist())
    assert tried == [[2, 4]] * 3
    last = drive(stage, state, 2, "blocked", at=1)
    assert last.route.state == "gave up"
    assert last.route.why == (
        "no route leads from place 2 to 4 but what could not be driven 3 times, from place 2 to 4; "
        "the last route ended because it was blocked: a chair"
    )
    assert last.path is not None
    assert not last.path.views  # there is nothing to drive to any more
    assert drive(stage, state, 2, "blocked", at=1).path is None


def test_a_medoid_that_was_not_seen_makes_its_place_less_likely_and_the_way_from_there_begin_behind_it():
    stage, state = ShortestPathPlanner(goal=3, search_s=0.0), ShortestPathPlannerState()
    drive(stage, state, 1)
    out = drive(stage, state, 1, "lost", at=0)
    assert state.failed_links.tolist() == [[1, 1]]
    assert out.path is not None
    assert out.path.names == ("on the way, image 60", "place 0, hall", "place 3")
    assert out.route.places.tolist() == [1, 0, 3]
    drive(stage, state, 1, "blocked", at=0)  # the picture that it began with
    assert state.failed_links.tolist() == [[1, 1], [1, 0]]
    doubtful = PlaceBelief(np.array([0.1, 0.5, 0.3, 0.0, 0.1, 0.0]), np.zeros((6, 3)))
    state.failures = np.array([1, 1])
    tick = Tick(0, 200_000_000 * next(TICKS))
    found = stage.step(
        Context("planning"), state, tick, doubtful, a_map(), None, DrivingStatus("lost"), under_way(state, 0)
    )
    assert found.route.places.tolist() == [2, 3]  # 0.3 against half of 0.5


def test_lost_again_as_it_sets_out_it_looks_around_before_it_goes_by_the_same_place(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(f"{MODULE}.SETTLE_S", 0.2)
    stage, state = ShortestPathPlanner(goal=3, search_s=2.0), ShortestPathPlannerState()
    planned = [drive(stage, state, 1).path is not None for _ in range(2)]
    planned += [drive(stage, state, 1, "lost", at=0).path is not None for _ in range(2)]
    assert planned == [False, True, False, True]  # the second begins behind the medoid
    again = [drive(stage, state, 1, "lost", at=0) for _ in range(11)]
    assert [out.path is not None for out in again] == 10 * [False] + [True]
    assert again[9].route.state == "locating"
    assert state.failed_links.tolist() == [[1, 1]]  # no link has failed: it may not be there at all
    assert state.failures.tolist() == [2]


def test_sure_of_another_place_it_looks_around_no_longer(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(f"{MODULE}.SETTLE_S", 0.2)
    stage, state = ShortestPathPlanner(goal=3, search_s=2.0), ShortestPathPlannerState()
    for _ in range(2):
        drive(stage, state, 1)
    for _ in range(3):
        drive(stage, state, 1, "lost", at=0)
    assert drive(stage, state, 4, "lost", at=0, share=0.45).path is None  # likelier, but not sure
    out = drive(stage, state, 4, "lost", at=0)
    assert out.path is not None
    assert out.route.places.tolist()[0] == 4


def test_lost_again_on_the_same_link_it_looks_around_too():
    stage, state = ShortestPathPlanner(goal=4, search_s=1.0), ShortestPathPlannerState()
    drive(stage, state, 2)
    assert drive(stage, state, 2, "lost", at=1).path is not None
    planned = [drive(stage, state, 2, "lost", at=1).path is not None for _ in range(6)]
    assert planned == 5 * [False] + [True]
    assert state.failed_links.tolist() == [[2, 4]]
    assert drive(stage, state, 2, "blocked", at=1).path is not None  # who stands before something need not look around


def test_a_medoid_counts_for_nothing_once_a_way_has_been_found_right():
    stage, state = ShortestPathPlanner(goal=3), ShortestPathPlannerState()
    drive(stage, state, 1)
    drive(stage, state, 1, "lost", at=0)
    drive(stage, state, 1, "driving", at=1)
    assert not len(state.failed_links)


def test_that_it_was_blocked_is_said_though_in_the_end_it_was_lost(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(f"{MODULE}.MAX_FAILURES", 2)
    stage, state = ShortestPathPlanner(goal=4, search_s=0.0), ShortestPathPlannerState()
    drive(stage, state, 2)
    drive(stage, state, 2, "blocked", at=1)
    last = drive(stage, state, 2, "lost", at=1)
    assert last.route.why.endswith("it was blocked: a chair; the last route ended because it was lost: too few matches")


def test_it_arrives_and_stays():
    stage, state = ShortestPathPlanner(goal=0), ShortestPathPlannerState()
    drive(stage, state, 1)
    assert drive(stage, state, 0, "arrived", at=2, arrived=True).route.state == "arrived"
    assert drive(stage, state, 4).route.state == "arrived"


def test_after_so_many_ways_it_gives_up_and_says_why():
    stage, state = ShortestPathPlanner(goal=3, search_s=0.0, max_routes=2), ShortestPathPlannerState()
    drive(stage, state, 1)
    drive(stage, state, 1, "lost", at=0)
    out = drive(stage, state, 1, "lost", at=0)
    assert out.route.state == "gave up"
    assert out.route.why == "2 routes were tried; the last route ended because it was lost: too few matches"
