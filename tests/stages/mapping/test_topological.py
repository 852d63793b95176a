"""A map of a made-up world's places, of which everything is known."""

import itertools
import math

import numpy as np
import pytest
from made_tour import Landmarks, Mapped, along, mapped, scattered
from made_views import made_views
from scipy.cluster.hierarchy import fcluster, linkage
from scipy.spatial.distance import squareform

from omninav.pipeline import Context
from omninav.pipeline.engine.codec import decode, encode
from omninav.stages.geometry.appearance.place_clusters import (
    between_hypotheses,
    complete_linkage,
    hypotheses,
    medoid,
    subclusters,
    waypoint_views,
)
from omninav.stages.geometry.appearance.visual_distance import ComparisonOptions, match_patches
from omninav.stages.mapping.loop_closure import LoopClosure
from omninav.stages.mapping.topological import TopologicalMapping
from omninav.stages.values.pose import Pose
from omninav.stages.values.topological_map import LOOP, LoopHypotheses, TopologicalMap

SQUARE = [(8.0, 8.0), (32.0, 8.0), (32.0, 32.0), (8.0, 32.0), (8.0, 8.0)]
SPREADS = "within_places", "all_views"
WORLD = Landmarks(scattered(40.0, 40.0))


def gaps(found: LoopHypotheses) -> np.ndarray:
    """How far apart the two views of each hypothesis were taken (m)."""
    return np.hypot(*np.diff(found.poses[found.pairs][:, :, :2], axis=1)[:, 0].T)


@pytest.fixture(scope="module")
def once() -> Mapped:
    return mapped(WORLD, [along(SQUARE, 1.2)])


@pytest.fixture(scope="module")
def twice() -> Mapped:
    return mapped(WORLD, [along(SQUARE + SQUARE[1:], 1.2)])


def test_in_a_cluster_no_two_views_are_further_apart_than_its_size() -> None:
    points = np.random.default_rng(0).random((60, 2))
    apart = np.hypot(*(points[:, None] - points[None]).transpose(2, 0, 1))
    cluster = complete_linkage(apart, 0.3)
    for number in range(cluster.max() + 1):
        assert apart[np.ix_(cluster == number, cluster == number)].max() <= 0.3
    by_scipy = fcluster(linkage(squareform(apart, checks=False), "complete"), 0.3, "distance")
    assert ((cluster[:, None] == cluster[None]) == (by_scipy[:, None] == by_scipy[None])).all()
    nothing = np.where(np.eye(4, dtype=bool), 0.0, math.inf)
    assert complete_linkage(nothing, 0.5).tolist() == [0, 1, 2, 3]


def test_a_cluster_falls_into_the_parts_that_the_drive_did_not_leave() -> None:
    cluster = np.array([0, 0, 1, 0, 0, 1, 1, 1])
    tour = np.array([0, 0, 0, 0, 0, 0, 1, 1])
    assert subclusters(cluster, tour).tolist() == [0, 0, 1, 2, 2, 3, 4, 4]


def test_every_two_parts_of_a_cluster_are_a_hypothesis() -> None:
    cluster = np.array([0, 0, 1, 0, 0, 1, 0])
    part = np.array([0, 0, 1, 2, 2, 3, 4])
    assert hypotheses(cluster, part).tolist() == [[0, 2], [0, 4], [1, 3], [2, 4]]


def test_hypotheses_are_as_far_apart_as_both_their_views_in_pictures() -> None:
    views = np.array([[0, 3], [1, 2], [3, 1]])
    frames = np.array([10, 12, 40, 50])
    apart = between_hypotheses(views, frames)
    assert apart[0, 1] == 2 + 10  # 10 with 12, 50 with 40
    assert apart[0, 2] == 2 + 0  # either way around
    assert (apart == apart.T).all()


def test_a_medoid_is_the_least_far_from_all_others() -> None:
    at = np.array([0.0, 1.0, 1.5, 5.0, 6.0, 9.0])
    assert medoid(np.abs(at[:, None] - at[None]), np.arange(5)) == 2


def test_path_images_are_few_and_each_sees_enough_of_the_one_before() -> None:
    at = np.arange(10)

    def matches(one: int, other: int) -> int:
        return 100 - 20 * abs(one - other)

    assert waypoint_views(matches, at, 40, 9).tolist() == [3, 6]
    assert waypoint_views(matches, at, 1000, 9).tolist() == list(range(1, 9))
    assert waypoint_views(matches, at, -100, 9).tolist() == []
    assert waypoint_views(matches, at, -100, 4).tolist() == [4, 8]


def test_a_ring_driven_once_is_a_ring_of_places(once: Mapped) -> None:
    made, found = once.map, once.hypotheses
    assert 10 < len(made) < 0.5 * len(found.poses)
    assert made.kinds.tolist() == [0] * len(made.links)
    neighbours = np.bincount(made.links.ravel(), minlength=len(made))
    assert (neighbours >= 1).all()
    steps = np.hypot(*np.diff(made.poses[made.places[made.links]][:, :, :2], axis=1)[:, 0].T)
    assert steps.max() < 10.0  # a robot sees 7 m far
    for link, (one, other) in enumerate(made.links):
        way = [int(view) for view in (made.places[one], *made.path_of(link), made.places[other])]
        for here, there in itertools.pairwise(way):
            seen = [WORLD.seen(Pose(*made.poses[view].tolist())) for view in (here, there)]
            found = len(match_patches(*(view.patches() for view in seen), ComparisonOptions()).first)
            assert found >= 20 or abs(made.frames[here] - made.frames[there]) == 1


def test_a_second_round_is_found_to_be_the_first(twice: Mapped) -> None:
    found = twice.hypotheses
    half = len(found.poses) // 2
    assert (gaps(found)[found.accepted] < 2.5).all()
    right = gaps(found) < 1.5
    assert found.accepted[right].mean() > 0.6
    same = np.mean([found.place[row] == found.place[row + half] for row in range(half)])
    assert same > 0.6
    assert (found.masses.sum(axis=1) == pytest.approx(1.0)) if len(found.masses) else False


def test_the_paper_s_deviation_is_that_of_all_views_that_have_anything_in_common() -> None:
    apart = np.array([[0.0, 1.0, 3.0], [1.0, 0.0, math.inf], [3.0, math.inf, 0.0]])
    assert made_views(apart).deviation() == 1.0  # of 1 and 3
    assert made_views(np.zeros((1, 1))).deviation() == 0.0
    within, over_all = (mapped(WORLD, [along(SQUARE[:3], 1.6)], spread=of).map.spread for of in SPREADS)
    assert over_all > 1.5 * within  # most views are of other places


def test_a_view_is_kept_small_and_can_still_be_matched(once: Mapped) -> None:
    made = once.map
    for place in (0, len(made) // 2):
        view = int(made.places[place])
        kept, seen = made.views.features(view), WORLD.seen(Pose(*made.poses[view].tolist()))
        pairs = match_patches(kept.patches(), seen.patches(), ComparisonOptions())
        assert len(pairs.first) == len(kept) <= 80
        apart = np.arccos(np.clip((kept.bearings[pairs.first] * seen.bearings[pairs.second]).sum(axis=1), -1.0, 1.0))
        assert apart.max() < math.radians(0.01)
    assert len(encode(made)) < len(made.views) * 12_500
    assert isinstance(decode(encode(made)), TopologicalMap)


def test_accepted_places_can_stay_two_with_a_link(twice: Mapped) -> None:
    found = LoopClosure(accepted="link").step(Context("loops"), twice.views).hypotheses
    linked = TopologicalMapping().step(Context("mapping"), twice.views, found).map
    assert len(linked) > len(twice.map)
    assert (linked.kinds == LOOP).sum() > 5
    loop = int(np.flatnonzero(linked.kinds == LOOP)[0])
    assert len(linked.path_of(loop)) == 0
    assert linked.link(*linked.links[loop][::-1]) == loop


def test_a_second_tour_is_recognised_by_the_few_features_that_a_map_keeps() -> None:
    world = Landmarks(scattered(40.0, 40.0, 2800))
    tour = along([(8.0, 8.0), (32.0, 8.0), (32.0, 20.0)], 1.6)
    aside = [Pose(pose.x + 0.2, pose.y + 0.2, pose.heading) for pose in tour]
    assert min(len(world.seen(pose)) for pose in tour) > 2 * 80  # of which 80 are kept
    known = mapped(world, [tour]).map
    found = mapped(world, [aside], known=known).hypotheses
    across = np.diff(found.tour[found.pairs], axis=1)[:, 0] != 0
    assert across.sum() >= 5
    assert found.accepted[across].mean() > 0.8
