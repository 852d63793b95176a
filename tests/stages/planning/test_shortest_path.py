"""Ways over a small map with a ring and a dead end, and what happens where they fail."""

import numpy as np
import pytest
from made_places import made_map

from omninav.pipeline import Context, Tick
from omninav.pipeline.graph.problems import BadInput
from omninav.stages.planning.shortest_path import (
    SETTLE_S,
    ShortestPathPlanner,
    ShortestPathPlannerState,
    place_in_image,
    places_called,
    shortest_route,
)
from omninav.stages.values.belief import PlaceBelief
from omninav.stages.values.commands import GOAL_TOPIC, GoalPoint
from omninav.stages.values.homing import DrivingStatus, PathProgress
from omninav.stages.values.topological_map import TopologicalMap
from omninav.stages.values.visual_distance import VisualDistances

# 0 - 1 - 2 - 3 in a row, 3 and 0 are neighbours by a loop, 4 hangs on 2 (driven from 4 to 2), 5 is on its own
BETWEEN = {(0, 1): 1, (1, 2): 0, (2, 3): 4, (4, 2): 2}
OPEN = {"failed_links": np.zeros((0, 2), np.int64), "failures": np.zeros(0, np.int64)}
MODULE = "omninav.stages.planning.shortest_path"


@pytest.fixture(autouse=True)
def plans_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(f"{MODULE}.SETTLE_S", 0.0)


def a_map() -> TopologicalMap:
    names = ("hall", "", "kitchen", "", "kitchen", "")
    return made_map([(float(n), 2.0 * n) for n in range(6)], BETWEEN, [(3, 0)], names)


def believed(place: int, share: float = 0.9) -> PlaceBelief:
    probabilities = np.full(6, (1.0 - share) / 5)
    probabilities[place] = share
    return PlaceBelief(probabilities, np.zeros((6, 3)))


class Planner:
    """The planner, at five ticks a second, of a robot that is led where it says."""

    def __init__(self, goal: int | str, **parameters: float) -> None:
        self.stage, self.state, self.ticks = ShortestPathPlanner(goal=goal, **parameters), ShortestPathPlannerState(), 0

    def look(self, belief: PlaceBelief | int, status=None, at: int | None = None, share=0.9, point=None):
        """The route of a robot that believes itself at a place, and drives, or does not, to the view `at` of it."""
        tick = Tick(0, 200_000_000 * (self.ticks % 1000), first_of_log=self.ticks % 1000 == 0)
        self.ticks += 1
        belief = believed(belief, share) if isinstance(belief, int) else belief
        why = "a chair" if status == "blocked" else "too few matches"
        doing = None if status is None else DrivingStatus(status, why)
        progress = None
        if at is not None:
            views = int(self.state.views[-1])
            progress = PathProgress(self.state.number, at, views, at, at >= views - 1, False, status == "arrived")
        return self.stage.step(Context("planning"), self.state, tick, belief, a_map(), None, doing, progress, point)


def planned(outs) -> list[bool]:
    return [out.path is not None for out in outs]


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


def places_to(told: VisualDistances) -> list[int]:
    stage, state = ShortestPathPlanner(goal="there.png"), ShortestPathPlannerState()
    return stage.step(Context("planning"), state, Tick(0, 0), believed(0), a_map(), told).route.places.tolist()


def test_a_picture_is_of_the_place_that_looks_most_like_it():
    assert places_to(distances(0.6, np.inf, 0.5, 0.7, 0.8, np.inf)) == [0, 1, 2]


def test_a_picture_of_no_place_is_refused_with_the_nearest():
    with pytest.raises(BadInput, match=r"there\.png is of no place .* place 4, kitchen, at a visual distance of 0\.70"):
        place_in_image("there.png", distances(0.9, np.inf, np.inf, np.inf, 0.7, np.inf), 0.5, a_map())
    with pytest.raises(BadInput, match=r"at a visual distance of 0\.51, where 0\.5 is allowed"):
        places_to(distances(0.51, *[np.inf] * 5))
    with pytest.raises(BadInput, match="too little in common with any"):
        place_in_image("there.png", distances(*[np.inf] * 6), 0.5, a_map())


def test_it_plans_once_it_is_sure_and_not_again(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(f"{MODULE}.SETTLE_S", 0.2)
    monkeypatch.setattr(f"{MODULE}.LOCATE_TIMEOUT_S", 1.0)
    planner = Planner(3)
    first = planner.look(1, share=0.4)
    assert (first.path, first.route.state, first.route.places.tolist()) == (None, "locating", [])
    second = planner.look(1, share=0.6)
    assert second.route.places.tolist() == [1, 0, 3]
    assert second.path.names == ("place 1", "on the way, image 60", "place 0, hall", "place 3")
    again = planner.look(0, "driving", at=2)
    assert (again.path, again.route.state) == (None, "under way")


def test_even_if_it_is_sure_it_looks_for_a_moment(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(f"{MODULE}.SETTLE_S", SETTLE_S)
    planner = Planner(3)
    assert planned(planner.look(1) for _ in range(6)) == [*5 * [False], True]


def test_whose_clock_is_set_back_looks_no_longer():
    planner = Planner(3)
    planner.ticks = 900
    assert not any(planned(planner.look(2, share=0.3) for _ in range(10)))
    planner.ticks = 1000
    assert planned(planner.look(2, share=0.3) for _ in range(26)) == [*25 * [False], True]


def test_who_looks_long_enough_goes_by_the_most_probable_place():
    planner = Planner(3)
    assert planned(planner.look(2, share=0.3) for _ in range(26)) == [*25 * [False], True]


def test_a_lost_target_means_a_new_way_from_where_it_is_now_believed():
    planner = Planner(3)
    planner.look(1)
    out = planner.look(2, "lost", at=1)
    assert (out.path.number, out.route.places.tolist()) == (1, [2, 3])


def test_a_target_that_is_seen_again_in_time_leaves_the_way_as_it_is(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(f"{MODULE}.SETTLE_S", 0.4)
    planner = Planner(3)
    for _ in range(3):
        planner.look(1)
    waiting = planner.look(1, "lost", at=1)
    assert (waiting.route.state, waiting.route.why) == ("locating", "lost: too few matches")
    going = planner.look(1, "driving", at=1)
    assert (going.path, going.route.state, going.route.number, going.route.why) == (None, "under way", 0, "")


def test_around_a_link_that_failed_there_may_be_another_way():
    planner = Planner("hall")
    assert planner.look(2).route.places.tolist() == [2, 1, 0]
    planner.state.failed_links, planner.state.failures = np.array([[0, 1]]), np.array([1])  # the other way round
    out = planner.look(1, "blocked", at=2)  # the medoids of 2 and 1 are reached: it is between 1 and 0
    assert (planner.state.failed_links.tolist(), planner.state.failures.tolist()) == ([[0, 1]], [2])
    assert out.route.places.tolist() == [1, 2, 3, 0]


def test_where_no_other_way_is_left_it_tries_some_times_and_then_gives_up_and_stands():
    planner = Planner(4)
    tried = [planner.look(2), *(planner.look(2, "blocked", at=1) for _ in range(2))]
    assert [out.route.places.tolist() for out in tried] == [[2, 4]] * 3
    last = planner.look(2, "blocked", at=1)
    assert last.route.state == "gave up"
    assert last.route.why == (
        "no route leads from place 2 to 4 but what could not be driven 3 times, from place 2 to 4; "
        "the last route ended because it was blocked: a chair"
    )
    assert last.path is not None
    assert (last.path.number, last.path.views) == (3, ())  # there is nothing to drive to any more
    assert planner.look(2, "blocked", at=1).path is None


def test_a_medoid_that_was_not_seen_makes_its_place_less_likely_and_the_way_from_there_begin_behind_it():
    planner = Planner(3, search_s=0.0)
    planner.look(1)
    out = planner.look(1, "lost", at=0)
    assert planner.state.failed_links.tolist() == [[1, 1]]
    assert out.path.names == ("on the way, image 60", "place 0, hall", "place 3")
    assert out.route.places.tolist() == [1, 0, 3]
    planner.look(1, "blocked", at=0)  # the picture that it began with
    assert planner.state.failed_links.tolist() == [[1, 1], [1, 0]]
    for other, places in ((0.12, [1, 2, 3]), (0.13, [2, 3])):  # against a quarter of 0.5, after the second time
        planner.state.failures = np.array([1, 1])
        found = planner.look(PlaceBelief(np.array([0.1, 0.5, other, 0.0, 0.1, 0.0]), np.zeros((6, 3))), "lost", at=0)
        assert found.route.places.tolist() == places
        assert planner.state.failures.tolist() == [2, 1]
    there = Planner(1, search_s=0.0)
    there.look(1)
    assert there.look(1, "lost", at=0).path.names == ("place 1",)  # the goal's own medoid is always gone to


def test_lost_again_as_it_sets_out_it_looks_around_before_it_goes_by_the_same_place(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(f"{MODULE}.SETTLE_S", 0.2)
    planner = Planner(3, search_s=2.0)
    assert planned(planner.look(1) for _ in range(2)) == [False, True]
    assert planned(planner.look(1, "lost", at=0) for _ in range(2)) == [False, True]  # it begins behind the medoid
    again = [planner.look(1, "lost", at=0) for _ in range(11)]
    assert planned(again) == 10 * [False] + [True]
    assert again[9].route.state == "locating"
    assert again[10].path.names[0] == "place 1"  # with the medoid again
    assert planner.state.failed_links.tolist() == [[1, 1]]  # no link has failed: it may not be there at all
    assert planner.state.failures.tolist() == [2]


def test_sure_of_another_place_it_looks_around_no_longer(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(f"{MODULE}.SETTLE_S", 0.2)
    planner = Planner(3, search_s=2.0)
    for _ in range(2):
        planner.look(1)
    for _ in range(2):
        planner.look(1, "lost", at=0)
    assert planner.look(4, "lost", at=0).path is None  # for a moment
    assert planner.look(4, "lost", at=0, share=0.45).path is None  # likelier, but not sure
    out = planner.look(4, "lost", at=0)
    assert out.path is not None
    assert out.route.places.tolist()[0] == 4


@pytest.mark.parametrize("share", [0.5, 0.49])
def test_on_its_first_route_too_it_looks_around_where_it_was_lost_before(share: float, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(f"{MODULE}.SETTLE_S", 0.4)
    planner = Planner(3, search_s=2.0)
    assert planned(planner.look(1) for _ in range(3)) == [False, False, True]
    planner.state.failed_links, planner.state.failures = np.array([[1, 1]]), np.array([1])
    belief = PlaceBelief(np.array([0.0, 0.3, 0.0, 0.0, share, 0.0]), np.zeros((6, 3)))
    outs = [planner.look(belief, "lost", at=0) for _ in range(11)]  # at least half sure of another place
    assert planned(outs).index(True) == (2 if share == 0.5 else 10)


def test_lost_again_on_the_same_link_it_looks_around_too():
    planner = Planner(4)
    planner.look(2)
    assert planned(planner.look(2, "lost", at=1) for _ in range(77)) == [True, *75 * [False], True]
    assert planner.state.failed_links.tolist() == [[2, 4]]
    assert planner.look(2, "blocked", at=1).path is not None  # who stands before something need not look around


def test_a_medoid_counts_for_nothing_once_a_way_has_been_found_right():
    planner = Planner(3)
    planner.look(1)
    planner.look(1, "lost", at=0)
    planner.look(1, "driving", at=0)
    assert planner.state.failed_links.tolist() == [[1, 1]]
    planner.state.failed_links, planner.state.failures = np.array([[1, 1], [2, 3]]), np.array([1, 2])
    planner.look(1, "driving", at=1)
    assert (planner.state.failed_links.tolist(), planner.state.failures.tolist()) == ([[2, 3]], [2])


def test_that_it_was_blocked_is_said_though_in_the_end_it_was_lost(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(f"{MODULE}.MAX_FAILURES", 2)
    planner = Planner(4, search_s=0.0)
    planner.look(2)
    planner.look(2, "blocked", at=1)
    why = planner.look(2, "lost", at=1).route.why
    assert why.endswith("it was blocked: a chair; the last route ended because it was lost: too few matches")


def test_it_arrives_and_stays():
    planner = Planner(0)
    planner.look(1)
    assert planner.look(0, "arrived", at=2).route.state == "arrived"
    assert planner.look(4).route.state == "arrived"


def test_after_so_many_ways_it_gives_up_and_says_why():
    planner = Planner(3, search_s=0.0)
    planner.look(1)
    for _ in range(19):
        planner.look(1, "driving", at=1)
        assert planner.look(1, "lost", at=0).path is not None
    route = planner.look(1, "lost", at=0).route
    assert route.state == "gave up"
    assert route.why == "20 routes were tried; the last route ended because it was lost: too few matches"


def test_a_robot_without_a_goal_waits_until_it_is_sent():
    planner = Planner(GOAL_TOPIC)
    waiting = [planner.look(1) for _ in range(10)]
    assert planned(waiting) == [False] * 10
    assert waiting[-1].route.state == "locating"
    outs = [planner.look(1, point=point) for point in (GoalPoint(0.9, 4.4), *[None] * 10)]
    assert planned(outs).count(True) == 1
    assert outs[-1].route.places.tolist() == [1, 2]


def test_a_robot_that_is_sent_elsewhere_looks_anew_and_goes_to_the_place_nearest_to_there(
    monkeypatch: pytest.MonkeyPatch,
):
    monkeypatch.setattr(f"{MODULE}.SETTLE_S", 0.4)
    planner = Planner(3)
    for _ in range(3):
        planner.look(1)
    planner.look(1, "lost", at=1)
    outs = [planner.look(1, "lost", at=1, point=point) for point in (GoalPoint(0.9, 4.4), None, None)]
    assert planned(outs) == [False, False, True]
    assert outs[-1].route.places.tolist() == [1, 2]
    assert not len(planner.state.failed_links)  # no link was at fault
    assert planner.look(2, "arrived", at=1).route.state == "arrived"
    outs = [planner.look(2, point=point) for point in (GoalPoint(0.0, 0.1), None, None)]
    assert outs[-1].route.places.tolist() == [2, 1, 0]


def test_another_goal_forgets_what_failed_on_the_way_to_the_last_one():
    planner = Planner(GOAL_TOPIC, search_s=0.0, max_routes=4)
    planner.look(1, point=GoalPoint(0.0, 6.0))
    outs = [planner.look(1, "blocked", at=1) for _ in range(6)]
    assert outs[-1].route.state == "gave up"
    assert planner.look(1, point=GoalPoint(0.0, 6.0)).route.state == "under way"
    assert (planner.state.planned, planner.state.blocked, len(planner.state.failures)) == (1, "", 0)
    assert not len(planner.state.failed_links)


def test_a_robot_that_is_blocked_before_the_first_view_is_where_it_believes_to_be():
    planner, belief = Planner(3), PlaceBelief(np.array([0.0, 0.6, 0.0, 0.0, 0.4, 0.0]), np.zeros((6, 3)))
    assert planner.look(belief).route.places[0] == 1
    assert planner.look(belief, "blocked", at=0).route.places[0] == 1
    assert planner.state.failed_links.tolist() == [[1, 0]]
    planner = Planner(1)
    planner.look(belief)
    assert planner.look(belief, "blocked", at=0).route.places.tolist() == [1]
