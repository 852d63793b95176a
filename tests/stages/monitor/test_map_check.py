import math
from dataclasses import replace

import numpy as np
import pytest
from landmark_tour import graph_of

from omninav.pipeline import Context
from omninav.stages.monitor.map_check import MAX_COMPARED, CheckMap, of_headings, of_poses
from omninav.stages.values.maps import ReferenceGraph


def drifting(number: int, turn_deg: float = 0.0) -> ReferenceGraph:
    """A map of views that change little by little, of a robot that turns by as much between two of them."""
    bins, around = np.arange(40.0), np.arange(36.0)
    headings = np.radians(turn_deg) * np.arange(number)
    views = []
    for place, heading in enumerate(headings):
        azimuths = heading - np.radians(10.0 * around)  # columns go clockwise
        middle = 14.0 + 12.0 * place / number + 6.0 * np.sin(azimuths) + 4.0 * np.cos(2.0 * azimuths)
        peaks = np.exp(-0.5 * ((bins - middle[:, None]) / 2.0) ** 2)
        views.append(peaks / peaks.sum(axis=1, keepdims=True))
    poses = np.column_stack([0.5 * np.arange(number), np.zeros(number), headings])
    return replace(graph_of(poses), features=np.asarray(views, np.float32))


def said(map: ReferenceGraph) -> tuple[str, ...]:
    ctx = Context("map_check")
    conflicts = CheckMap().step(ctx, map).conflicts
    assert conflicts.sentences == conflicts.standing == tuple(ctx.warnings)
    assert conflicts.misleading == bool(ctx.warnings)
    return conflicts.sentences


@pytest.mark.parametrize(("number", "judged"), [(19, False), (20, True)])
def test_a_small_map_is_not_judged(number: int, judged: bool) -> None:
    assert bool(said(graph_of(np.zeros((number, 3))))) == judged  # all at one place


@pytest.mark.parametrize(
    ("extent_m", "said"),
    [
        (0.0, "all 30 references of the map are at one place, within 0 m: check its positions"),
        (0.009, "all 30 references"),
        (0.011, ""),
        (29 * 49.9, ""),
        (29 * 50.1, "the map's images are 50.1 m apart"),
    ],
)
def test_a_map_has_an_extent_and_a_spacing(extent_m: float, said: str) -> None:
    found = of_poses(np.column_stack([np.linspace(0.0, extent_m, 30), np.zeros((30, 2))]))
    assert found.startswith(said)
    assert bool(found) == bool(said)


@pytest.mark.parametrize(("times", "lost"), [(990.0, False), (1010.0, True)])
def test_a_reference_is_lost_a_thousand_times_further_away_than_half_of_all(times: float, lost: bool) -> None:
    poses = np.zeros((101, 3))
    poses[:, :2] = np.column_stack([np.cos(np.arange(101.0)), np.sin(np.arange(101.0))])
    poses[40, :2] = times, 0.0
    poses[:, :2] += 700.0, -300.0  # wherever its frame begins
    found = of_poses(poses)
    assert ("reference 40 of the map is 1010 m from its middle" in found) == lost
    assert bool(found) == lost


def test_a_lost_reference_of_a_map_in_a_corner_is_measured_by_its_smallest_extent() -> None:
    poses = np.zeros((101, 3))
    poses[40, 0] = 9.9  # half of all within 0 m: as if within a centimetre
    assert of_poses(poses) == ""
    poses[40, 0] = 10.1
    assert "reference 40 of the map is 10 m from its middle, half of all within 0 m" in of_poses(poses)


def test_headings_are_judged_by_neighbours_that_turn() -> None:
    turned = np.radians(np.linspace(-60.0, 60.0, 30))
    assert of_headings(turned, turned) == ""
    assert "headings turn against its images" in of_headings(turned, -turned)
    assert of_headings(np.zeros(30), np.zeros(30)) == ""
    headings = math.radians(40.0) * (-1.0) ** np.arange(100)
    for against, said in ((62, False), (63, True)):  # by more than a quarter of them all
        seen = np.where(np.arange(100) < against, -headings, headings)
        assert bool(of_headings(seen, headings)) == said


@pytest.mark.parametrize(
    ("number", "degrees", "said"), [(9, 40.0, False), (10, 40.0, True), (30, 9.9, False), (30, 10.1, True)]
)
def test_ten_turns_of_ten_degrees_say_in_which_sense_headings_are_counted(
    number: int, degrees: float, said: bool
) -> None:
    headings = np.append(math.radians(degrees) * (-1.0) ** np.arange(number), np.zeros(40))
    found = of_headings(-headings, headings)
    assert bool(found) == said
    if said:
        assert f"({number} pairs of neighbours)" in found


def test_views_that_change_along_the_way_fit_their_poses_and_shuffled_ones_do_not() -> None:
    map = drifting(60, 7.0)
    assert said(map) == ()
    order = np.random.default_rng(0).permutation(60)
    (found,) = said(replace(map, poses=map.poses[order]))
    assert found.startswith("the map's poses do not fit its images: a neighbour in space is more similar than another")
    assert 40 <= int(found.partition("image in ")[2].split()[0]) <= 60


def test_headings_that_are_counted_clockwise_are_said() -> None:
    map = drifting(60, 7.0)
    poses = map.poses * (1.0, 1.0, -1.0)
    (found,) = said(replace(map, poses=poses))
    assert "headings counted clockwise" in found


def test_views_of_one_segment_are_not_compared() -> None:
    map = drifting(60)
    shuffled = map.poses[np.random.default_rng(0).permutation(60)]
    assert said(replace(map, poses=shuffled, features=map.features[:, :1])) == ()
    assert said(replace(map, poses=shuffled, features=map.features[:, :2]))


def test_of_a_large_map_an_image_is_compared_with_some_and_with_its_neighbours() -> None:
    map = drifting(MAX_COMPARED + 100)
    assert said(map) == ()
    shuffled = 0.1 * map.poses[np.random.default_rng(0).permutation(len(map))]
    (found,) = said(replace(map, poses=shuffled))
    assert "do not fit its images" in found
