"""Pictures of drives over a topological map: the way planned over the floor plan, the belief in every place."""

import re

import numpy as np
import pytest
from made_places import made_map
from measured_drives import made_drive

from omninav.pipeline import Context
from omninav.stages.plots.place_belief_over_time import PlaceBeliefOverTime, binned, with_neighbours
from omninav.stages.plots.trajectory_over_map import TrajectoryOverMap, planned_routes
from omninav.stages.plots.true_and_estimated_place import BESIDE, RIGHT, WRONG, TrueAndEstimatedPlace, judged
from omninav.stages.values.belief import PlaceBelief
from omninav.stages.values.commands import GoalPoint
from omninav.stages.values.episode_statistics import EpisodeStatistics
from omninav.stages.values.floor_plan import FloorPlan
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.planned_route import PlannedRoute

CTX = Context("view")
MAP = made_map([(1.0, 1.0), (4.0, 1.0), (4.0, 4.0), (1.0, 4.0)], {(0, 1): 1, (1, 2): 0, (2, 3): 2})
PLAN = FloorPlan(np.array([[(2.0, 2.0), (3.0, 2.0), (3.0, 3.0), (2.0, 3.0)]]), 6.0, 5.0)
TRUTH = [(1.01 + 0.15 * k, 1.1, 0.0) for k in range(20)]
DRIVE, BLIND = made_drive(TRUTH, every_s=0.2), made_drive([None] * 20, every_s=0.2)


def green(plot) -> int:
    """Points of what is drawn in the colour of ways and true places, but for the legend."""
    marks = re.findall(r'<(?:path d|rect x|circle cx)="([^"]*)"[^>]*--green', plot.content.decode().split("</svg>")[0])
    return sum(max(1, len(re.findall("[ML]", words))) for words in marks)


def drawn(contact=99, **rest):
    tallies = [EpisodeStatistics(int(k >= contact), 0.15 * k) for k in range(20)]
    drive = made_drive(TRUTH, motion=[(0.15, 0.0, 0.0)] * 20, every_s=0.2, tallies=tallies)
    return TrajectoryOverMap().step(CTX, drive, plan=PLAN, **rest).plot


def test_the_way_planned_is_drawn_over_the_plan_with_its_goal():
    ways = [None] * 3 + [PlannedRoute(np.array([0, 1, 2]), "under way", 0)] * 7
    ways += [PlannedRoute(np.array([1, 2, 3]), "under way", 1)] * 10
    plain, mapped, planned = drawn(), drawn(map=MAP, routes=[None] * 20), drawn(map=MAP, routes=ways)
    assert green(planned) > 4 * green(plain) > 0  # the start
    assert "route" not in plain.caption
    assert "collided 0 times" in plain.caption
    assert "4 places" in mapped.caption
    assert "It planned no route" in mapped.caption
    assert "thin: the 1 before it" in planned.caption
    assert planned.content == drawn(map=MAP, routes=ways).content
    first, last = planned_routes(ways, MAP)
    assert first.tolist() == [[1.0, 1.0], [1.0, 1.0], [4.0, 1.0], [4.0, 4.0]]  # path images lie at their owner's
    assert len(last) == 5
    references = ReferenceGraph(MAP.poses, np.zeros((4, 1, 1)), "histograms", np.zeros((0, 2), np.int64), "truth")
    beside = PlannedRoute(np.array([0, 1]), "under way", 0, goal=GoalPoint(5.0, 1.5))
    assert planned_routes([beside], references)[0].tolist() == [[1.0, 1.0], [4.0, 1.0], [5.0, 1.5]]


def test_a_contact_of_a_robot_that_drives_itself_is_marked_where_it_was():
    free, touched = drawn(), drawn(contact=9)
    assert b"contact" not in free.content
    assert b"contact" in touched.content
    assert "collided 1 time " in touched.caption


def believed() -> list[PlaceBelief | None]:
    steps = np.linspace(0.0, 1.0, 20)
    shares = np.column_stack([0.7 * (1 - steps) + 0.1, 0.7 * steps + 0.1, np.full(20, 0.06), np.full(20, 0.04)])
    return [None, *(PlaceBelief(row, np.zeros((4, 3))) for row in shares[1:])]


def test_the_belief_in_every_place_is_drawn_with_the_truth_beside_it():
    stage = PlaceBeliefOverTime()
    plot = stage.step(CTX, DRIVE, believed(), MAP).plot
    blind = stage.step(CTX, BLIND, believed(), MAP).plot
    assert plot.content == stage.step(CTX, DRIVE, believed(), MAP).plot.content
    assert green(plot) > 10 > green(blind)
    assert "In 100 % of the images" in plot.caption  # the nearest place and the belief change at the same time
    assert "truly nearest." not in blind.caption
    assert stage.step(CTX, DRIVE, [None] * 20, MAP).plot is None


def test_a_places_neighbours_are_those_that_it_is_linked_with():
    shares = np.array([[0.4, 0.3, 0.2, 0.1]] * 3)
    alone, around = with_neighbours(shares, np.array([0, 2, -1]), MAP)
    assert alone[:2] == pytest.approx([0.4, 0.2])
    assert around[:2] == pytest.approx([0.7, 0.6])
    assert np.isnan(alone[2])
    assert np.isnan(around[2])


def test_of_a_long_drive_the_most_that_was_believed_is_kept():
    shares = np.zeros((1000, 2))
    shares[777, 1] = 0.9
    seconds = np.arange(1000) + 0.5
    fewer = binned(shares, seconds, np.linspace(0, 1000, 101), 1.0)
    assert fewer.shape == (100, 2)
    assert fewer[77].tolist() == [0.0, 0.9]
    assert (binned(shares, seconds, np.arange(1001.0), 1.0) == shares).all()


def test_a_belief_is_drawn_at_its_time_and_no_longer_than_two_steps():
    shares, seconds = np.array([[0.1], [0.2], [0.3]]), np.array([0.5, 1.5, 7.5])
    drawn = binned(shares, seconds, np.arange(9.0), 1.0)[:, 0]
    np.testing.assert_array_equal(drawn, [0.1, 0.2, 0.2, 0.2, np.nan, np.nan, np.nan, 0.3])


def test_a_believed_place_is_the_nearest_or_beside_it_or_another():
    path = np.array([(1.1, 1.0), (1.1, 1.0), (1.1, 1.0), (3.9, 3.8)])
    assert judged(path, np.array([0, 1, 2, 2]), MAP).tolist() == [RIGHT, BESIDE, WRONG, RIGHT]


def test_pictures_are_joined_with_the_places_believed():
    stage = TrueAndEstimatedPlace()
    plot = stage.step(CTX, DRIVE, believed(), MAP).plot
    wrong = stage.step(CTX, made_drive(TRUTH[::-1], every_s=0.2), believed(), MAP).plot
    assert plot.content == stage.step(CTX, DRIVE, believed(), MAP).plot.content
    assert green(plot) > 2 * green(wrong)
    assert "green, 100 % of the images" in plot.caption
    assert stage.step(CTX, BLIND, believed(), MAP).plot is None
