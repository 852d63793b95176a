"""What became of a drive to a goal, on a corner of two legs."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from made_places import made_map
from measured_drives import AT_ORIGIN, figures, made_drive

from omninav.stages.metrics.navigation import Navigation, lost_metres, shortest_metres
from omninav.stages.values.commands import GoalPoint
from omninav.stages.values.episode_statistics import EpisodeStatistics
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.planned_route import PlannedRoute

# 3 m east, then 4 m north; place 3 lies apart
CORNER = made_map([(0.0, 0.0), (3.0, 0.0), (3.0, 4.0), (9.0, 9.0)], {(0, 1): 0, (1, 2): 0})
PLACES = np.array([0, 1, 2])


def navigated(drive, ways, map=CORNER):
    found = figures(Navigation(), drive, ways, map)
    return found and found["navigation"]


def ended(spots, states, collisions=0, driven=0.0, map=CORNER, tallied=True):
    ways = [
        each if isinstance(each, PlannedRoute) else PlannedRoute(PLACES, each, 0, "tired" if each == "gave up" else "")
        for each in states
    ]
    counts, metres = (np.broadcast_to(each, len(spots)).tolist() for each in (collisions, driven))
    tallies = [EpisodeStatistics(*each) for each in zip(counts, metres, strict=True)]
    drive = made_drive([(x, y, 0.0) for x, y in spots], tallies=tallies if tallied else None)
    return navigated(drive, ways, map)


def test_a_drive_along_the_map_has_its_length_and_ends_when_it_says_so():
    spots = [(0.0, 0.0), (3.0, 0.0), (3.0, 4.0), (3.0, 3.8)]
    found = ended(spots, ["under way", "under way", "arrived", "arrived"], driven=7.2)
    assert found == {
        "reached": True,
        "reached_rate": 1.0,
        "collision_free_rate": 1.0,
        "collisions": 0,
        "end_error_m": pytest.approx(0.2),
        "reached_error_m": pytest.approx(0.2),
        "path_length_m": pytest.approx(7.2),
        "shortest_m": pytest.approx(7.0),
        "path_length_ratio": pytest.approx(7.2 / 7.0),
        "time_s": 2.0,
        "time_per_metre_s": pytest.approx(2.0 / 7.0),
        "goal": 2,
        "routes": 1,
        "state": "arrived",
        "reason": None,
    }


def test_of_a_real_robot_no_contacts_are_claimed_and_odometry_measures_its_path():
    found = ended([(0.0, 0.0), (3.0, 4.0)], ["under way", "arrived"], tallied=False)
    assert found["reached"]
    assert not {"collisions", "collision_free_rate"} & found.keys()
    assert found["path_length_m"] == 0.0  # it knows of no motion


def test_metres_driven_while_the_estimate_is_wrong_are_lost_and_none_of_a_robot_that_stands():
    truth, driven = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [4, 0, 0]]), np.array([0.0, 1.0, 2.0, 4.0])
    estimate = truth + np.array([[0.4, 0, 0], [0.6, 0, 0], [np.nan] * 3, [9, 0, 0]])
    drive = SimpleNamespace(truth=truth, estimate=estimate, distance=driven)
    assert lost_metres(drive) == pytest.approx(750.0)
    assert lost_metres(SimpleNamespace(truth=truth, estimate=estimate, distance=np.zeros(4))) is None


@pytest.mark.parametrize(
    ("last", "state"), [((3.0, 3.0), "arrived"), ((3.0, 4.0), "under way"), ((3.0, 4.0), "gave up")]
)
def test_who_stands_elsewhere_or_does_not_know_that_it_is_there_has_not_reached_it(last, state):
    found = ended([(0.0, 0.0), last], ["under way", state])
    assert not found["reached"]
    assert (found["reached_rate"], found["collision_free_rate"]) == (0.0, 0.0)
    assert "path_length_ratio" not in found
    assert found["reason"] == ("tired" if state == "gave up" else None)


def test_who_bumped_into_something_reached_it_but_not_cleanly():
    found = ended([(0.0, 0.0), (3.0, 4.0)], ["under way", "arrived"], collisions=1)
    assert (found["reached_rate"], found["collision_free_rate"]) == (1.0, 0.0)


def test_of_a_map_of_odometry_it_is_not_said_where_its_places_are():
    odometry = dataclasses.replace(CORNER, pose_source="odometry")
    found = ended([(0.0, 0.0), (3.0, 4.0)], ["under way", "arrived"], driven=5.0, map=odometry)
    assert "reached" not in found
    assert (found["end_error_m"], found["shortest_m"]) == (None, None)
    assert (found["path_length_m"], found["state"]) == (5.0, "arrived")


@pytest.mark.parametrize(("states", "seconds"), [(["under way"] * 4, 3.0), (["under way", *["gave up"] * 3], 1.0)])
def test_the_time_of_a_drive_ends_when_it_gives_up_or_else_with_it(states, seconds):
    assert ended([(0.0, 0.0)] * 4, states)["time_s"] == seconds


def test_the_shortest_way_begins_at_the_closest_view():
    assert shortest_metres(CORNER, (0.0, -1.0), 2) == pytest.approx(8.0)
    assert shortest_metres(CORNER, (3.0, 4.5), 2) == pytest.approx(0.5)
    assert shortest_metres(CORNER, (9.0, 9.0), 2) == pytest.approx(7.81, abs=0.01)  # no way from there but straight


def test_without_a_way_there_is_nothing_to_say():
    assert navigated(made_drive([AT_ORIGIN]), [None]) is None


def test_the_goal_is_reached_up_to_half_a_metre_from_it():
    reached = [ended([(0.0, 0.0), (3.0, 4.0 - off)], ["under way", "arrived"])["reached"] for off in (0.5, 0.625)]
    assert reached == [True, False]


def test_the_last_route_that_was_planned_counts_and_it_is_the_third():
    ways = [PlannedRoute(np.array([2, 1]), "under way", 0), PlannedRoute(np.array([0, 1]), "arrived", 2), None]
    truth, motion = [AT_ORIGIN, (3.0, 0.0, 0.0), (3.0, 0.0, 0.0)], [None, (3.0, 4.0, 0.1), (0.5, 0.0, 0.0)]
    found = navigated(made_drive(truth, motion=motion), ways)
    assert (found["goal"], found["routes"], found["reached"], found["time_s"]) == (1, 3, True, 1.0)
    assert (found["path_length_m"], found["shortest_m"]) == pytest.approx((5.5, 3.0))


def test_of_a_tally_that_ends_early_the_last_entry_counts():
    tallies = [EpisodeStatistics(0, 0.5), EpisodeStatistics(0, 1.5), EpisodeStatistics(1, 2.5), None]
    found = navigated(made_drive([AT_ORIGIN] * 4, tallies=tallies), [PlannedRoute(PLACES, "under way", 0)] * 4)
    assert (found["path_length_m"], found["collisions"]) == (2.5, 1)


def test_who_was_at_the_goal_already_has_no_ratio_and_who_has_no_route_no_goal():
    there = ended([(3.0, 4.0)] * 2, ["under way", "arrived"])
    assert (there["reached_rate"], there["shortest_m"], there["reached_error_m"]) == (1.0, 0.0, 0.0)
    assert not {"path_length_ratio", "time_per_metre_s"} & there.keys()
    nowhere = PlannedRoute(np.empty(0, np.int64), "gave up", 0, "no way")
    found = navigated(made_drive([AT_ORIGIN]), [nowhere])
    assert (found["goal"], found["end_error_m"], found["shortest_m"], found["reached"]) == (None, None, None, False)
    assert navigated(made_drive([None]), [nowhere]) is None


def test_a_way_along_path_images_is_as_long_as_they_lie_apart():
    made = made_map([(0.0, 0.0), (4.0, 0.0)], {(0, 1): 1})
    poses = made.poses.copy()
    poses[2, :2] = (2.0, 1.5)  # the path image
    bent = dataclasses.replace(made, poses=poses)
    assert shortest_metres(bent, (0.0, 0.0), 1) == pytest.approx(5.0)
    assert shortest_metres(bent, (2.0, 2.5), 1) == pytest.approx(3.5)


def test_on_a_map_of_references_the_goal_is_a_point_beside_them():
    routes = [PlannedRoute(np.array([0, 1]), "arrived", 0, goal=GoalPoint(4.0, 1.0)) for _ in range(2)]
    poses, edges = np.array([AT_ORIGIN, (4.0, 0.0, 0.0)]), np.array([(0, 1)], np.int64)
    graph = ReferenceGraph(poses, np.zeros((2, 1, 1), np.float32), "histograms", edges, "truth")
    found = ended([(0.0, 1.0), (4.0, 0.9)], routes, driven=6.6, map=graph)
    assert found["reached"]
    assert found["end_error_m"] == pytest.approx(0.1)
    assert found["shortest_m"] == pytest.approx(1.0 + 4.0 + 1.0)
    assert found["path_length_ratio"] == pytest.approx(1.1)


def test_after_a_new_goal_on_the_way_all_figures_are_of_that_one():
    spots = [(0.0, 0.0), (3.0, 0.0), (3.0, 0.0), (3.0, 4.0)]
    first, other = np.array([0, 1]), np.array([1, 2])
    ways = [PlannedRoute(first, "under way", 0), PlannedRoute(first, "arrived", 0)]
    ways += [PlannedRoute(other, "under way", 1), PlannedRoute(other, "arrived", 1)]
    found = ended(spots, ways, collisions=[0, 1, 1, 1], driven=[0.0, 3.0, 3.0, 7.5])
    assert (found["goal"], found["routes"], found["time_s"], found["collisions"]) == (2, 1, 1.0, 0)
    assert (found["shortest_m"], found["path_length_m"]) == pytest.approx((4.0, 4.5))
    assert (found["goals"], found["goals_reached_rate"]) == (2, 1.0)


def test_of_three_goals_the_share_that_was_reached_is_told_beside_the_last():
    spots = [(0.0, 0.0), (3.0, 0.0), (3.0, 0.0), (3.0, 2.0), (3.0, 2.0), (3.0, 0.0)]
    to_corner, on = np.array([0, 1]), np.array([1, 2])
    ways = [PlannedRoute(to_corner, state, 0) for state in ("under way", "arrived")]
    ways += [PlannedRoute(on, "under way", 1), PlannedRoute(on, "gave up", 1, "tired")]
    ways += [PlannedRoute(on[::-1], state, 2) for state in ("under way", "arrived")]
    found = ended(spots, ways)
    assert (found["goals"], found["reached_rate"], found["goals_reached_rate"]) == (3, 1.0, pytest.approx(2 / 3))
